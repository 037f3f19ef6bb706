// toml++ without its assertions: with them, a control character where a key should begin ends the
// program, one line before the library would have refused it properly.
#pragma once

#define TOML_ASSERT(condition) static_assert(true)
#include <toml++/toml.h>

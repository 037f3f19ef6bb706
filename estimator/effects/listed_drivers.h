// What the listed effects are functions of, in the words that structures without a name have.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "estimator/effects/smooth_term.h"

namespace plumbline {

/// Any of the drivers shows the effect; they are named as those of structures.
struct ListedDrivers {
  TermForm form = TermForm::bias;
  std::vector<std::string> drivers;
};

/// Of a listed effect, or of a recorded column, on an axis; nothing for what is a constant of the
/// head or of the converter, which no structure could follow as well.
std::optional<ListedDrivers> drivers_of(const Effect& effect, std::size_t axis);

}  // namespace plumbline

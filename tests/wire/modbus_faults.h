// What holds on both lines: a fault costs one call its deadline at most, and never a wrong value.
#pragma once

#include <gtest/gtest.h>

#include "tests/wire/scripted_server.h"

namespace plumbline::rig {

/// Sets the position registers of both axes to a value that tells readings apart.
inline void set_position(ScriptedServer& server, int counts) {
  for (const int base : {0x000, 0x100}) {
    server.set_register(base + 0x22, static_cast<std::uint16_t>(counts >> 16));
    server.set_register(base + 0x23, static_cast<std::uint16_t>(counts & 0xFFFF));
  }
}

/// Runs `call` and checks that it ended in time.
template <class Call>
auto in_time(const Call& call) {
  const auto before = std::chrono::steady_clock::now();
  auto result = call();
  EXPECT_LT(std::chrono::steady_clock::now() - before, kCallLimit);
  return result;
}

/// Meets `script` while reading, with positions that change at each call: whatever comes back is
/// of this very call, and once the script is over the calls work again.
inline void survives(ScriptedServer& server, std::vector<Misdeed> script) {
  ModbusHead head(config_for(server), *parse_modbus_endpoint(server.endpoint()));
  set_position(server, 10000);
  const auto connected = in_time([&] { return head.connect(); });
  ASSERT_TRUE(connected) << connected.error().message;
  server.misbehave(std::move(script));
  bool works = false;
  for (int call = 2; call < 12; ++call) {
    set_position(server, 10000 * call);
    const auto status = in_time([&] { return head.status(); });
    works = status.has_value();
    if (!status) {
      EXPECT_EQ(status.error().code, ErrorCode::rig);
      EXPECT_NE(status.error().message.find(server.endpoint().substr(0, 8)), std::string::npos)
          << status.error().message;
      continue;
    }
    EXPECT_DOUBLE_EQ(status->actual.delta_deg, call);
    EXPECT_DOUBLE_EQ(status->actual.h_deg, call);
  }
  EXPECT_TRUE(works);
}

}  // namespace plumbline::rig

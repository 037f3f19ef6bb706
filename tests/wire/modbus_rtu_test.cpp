#include <gtest/gtest.h>

#include "tests/wire/modbus_faults.h"

namespace plumbline::rig {
namespace {

using Kind = Misdeed::Kind;

class ModbusRtuFault : public ::testing::TestWithParam<Kind> {};

TEST_P(ModbusRtuFault, OneReplyIsSurvivedWithoutAWrongValue) {
  ScriptedServer server(ScriptedServer::Line::rtu);
  survives(server, {{GetParam(), kResponseTimeout * 3 / 2, 4}});
}

TEST_P(ModbusRtuFault, ThreeRepliesInARowAreSurvivedWithoutAWrongValue) {
  ScriptedServer server(ScriptedServer::Line::rtu);
  const Misdeed misdeed{GetParam(), kResponseTimeout * 3 / 2, 4};
  survives(server, {misdeed, misdeed, misdeed});
}

INSTANTIATE_TEST_SUITE_P(All, ModbusRtuFault,
                         ::testing::Values(Kind::late, Kind::wrong_unit, Kind::truncated,
                                           Kind::exception, Kind::silence, Kind::garbage,
                                           Kind::wrong_function, Kind::wrong_length, Kind::doubled,
                                           Kind::bad_crc));

TEST(ModbusRtu, AReplyLaterThanAllWaitingIsNotTakenForTheNext) {
  for (const int quarters : {5, 9, 11, 13}) {
    ScriptedServer server(ScriptedServer::Line::rtu);
    survives(server, {{Kind::late, kResponseTimeout * quarters / 4, 0}});
  }
}

TEST(ModbusRtu, AbsentDeviceIsNamed) {
  HeadConfig config;
  const std::string endpoint = "rtu:/dev/no-such-device,115200,8E1";
  ModbusHead head(config, *parse_modbus_endpoint(endpoint));
  const auto connected = in_time([&] { return head.connect(); });
  ASSERT_FALSE(connected);
  EXPECT_EQ(connected.error().message,
            "spindle (delta) axis: " + endpoint +
                ": cannot connect: No such file or directory: is the adapter plugged in, and may "
                "this user open it?");
}

}  // namespace
}  // namespace plumbline::rig

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>

#include "tests/wire/modbus_faults.h"

namespace plumbline::rig {
namespace {

using Kind = Misdeed::Kind;

class ModbusTcp : public ::testing::Test {
 protected:
  ScriptedServer server{ScriptedServer::Line::tcp};
};

class ModbusTcpFault : public ::testing::TestWithParam<Kind> {};

TEST_P(ModbusTcpFault, OneReplyIsSurvivedWithoutAWrongValue) {
  ScriptedServer server(ScriptedServer::Line::tcp);
  survives(server, {{GetParam(), kResponseTimeout * 3 / 2, 4}});
}

TEST_P(ModbusTcpFault, ThreeRepliesInARowAreSurvivedWithoutAWrongValue) {
  ScriptedServer server(ScriptedServer::Line::tcp);
  const Misdeed misdeed{GetParam(), kResponseTimeout * 3 / 2, 4};
  survives(server, {misdeed, misdeed, misdeed});
}

INSTANTIATE_TEST_SUITE_P(All, ModbusTcpFault,
                         ::testing::Values(Kind::late, Kind::wrong_transaction, Kind::wrong_unit,
                                           Kind::truncated, Kind::exception, Kind::silence,
                                           Kind::reset, Kind::garbage, Kind::wrong_function,
                                           Kind::wrong_length, Kind::doubled));

TEST_F(ModbusTcp, ExceptionsOneToSixAreNamedAndLeaveTheConnectionInStep) {
  ModbusHead head(config_for(server), *parse_modbus_endpoint(server.endpoint()));
  ASSERT_TRUE(head.connect());
  for (std::uint8_t code = 1; code <= 6; ++code) {
    server.misbehave({{Kind::exception, {}, code}});
    const auto status = in_time([&] { return head.status(); });
    ASSERT_FALSE(status);
    EXPECT_EQ(status.error().message, "spindle (delta) axis: " + server.endpoint() +
                                          " unit 1: the drive refused: exception " +
                                          std::to_string(code) + " (" + exception_text(code) + ")");
    EXPECT_TRUE(head.status());
  }
}

TEST_F(ModbusTcp, WrongUnitIdGetsAClearMessageInTime) {
  HeadConfig config = config_for(server);
  config.unit_id = {9, 9};
  ModbusHead head(config, *parse_modbus_endpoint(server.endpoint()));
  const auto connected = in_time([&] { return head.connect(); });
  ASSERT_FALSE(connected);
  EXPECT_NE(connected.error().message.find("unit 9: no reply within 0.1 s: is the drive on, is the "
                                           "unit id right?"),
            std::string::npos)
      << connected.error().message;
}

TEST_F(ModbusTcp, AbsentServerGetsAClearMessageInTime) {
  // A port that is bound but not listened on refuses connections.
  const int fd = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  ASSERT_EQ(bind(fd, reinterpret_cast<sockaddr*>(&address), size), 0);
  ASSERT_EQ(getsockname(fd, reinterpret_cast<sockaddr*>(&address), &size), 0);
  const std::string endpoint = "tcp:127.0.0.1:" + std::to_string(ntohs(address.sin_port));
  ModbusHead head(config_for(server), *parse_modbus_endpoint(endpoint));
  const auto connected = in_time([&] { return head.connect(); });
  ASSERT_FALSE(connected);
  EXPECT_EQ(connected.error().message,
            "spindle (delta) axis: " + endpoint +
                ": cannot connect: Connection refused: is the drive on and connected, are address "
                "and port right?");
  ::close(fd);
}

TEST_F(ModbusTcp, InPositionOnlyWhenBothEchoesAreOfTheLastCommand) {
  ModbusHead head(config_for(server), *parse_modbus_endpoint(server.endpoint()));
  for (const int base : {0x000, 0x100}) server.set_register(base + 0x20, 0x4031);
  ASSERT_TRUE(head.connect());
  EXPECT_FALSE(head.status()->in_position) << "nothing has been commanded";
  ASSERT_TRUE(head.start_move({90, 10}));
  EXPECT_TRUE(head.status()->in_position);
  server.set_register(0x127, 1);
  EXPECT_FALSE(head.status()->in_position) << "target echo of h";
  ASSERT_TRUE(head.start_move({90, 10}));
  EXPECT_TRUE(head.status()->in_position);
  server.set_register(0x2A, 77);
  EXPECT_FALSE(head.status()->in_position) << "sequence echo of delta";
}

TEST_F(ModbusTcp, AMoveWritesItsRegistersAndOneStartEdge) {
  server.set_register(0x2A, 41);  // an earlier program's last command
  ModbusHead head(config_for(server), *parse_modbus_endpoint(server.endpoint()));
  ASSERT_TRUE(head.connect());
  ASSERT_TRUE(head.start_move({-10, 20}));
  EXPECT_EQ(server.get_register(0x02), 0xFFFE);  // -100000
  EXPECT_EQ(server.get_register(0x03), 0x7960);
  EXPECT_EQ(server.get_register(0x0A), 1);
  EXPECT_EQ(server.get_register(0x0B), 42);
  EXPECT_EQ(server.writes_to(0x000), (std::vector<std::uint16_t>{0, 8, 0}));
  ASSERT_TRUE(head.start_move({0, 0}));
  EXPECT_EQ(server.get_register(0x0B), 43);
  EXPECT_EQ(server.writes_to(0x000), (std::vector<std::uint16_t>{0, 8, 0, 8, 0}));
}

TEST_F(ModbusTcp, AStartWhoseAcknowledgementIsLostIsNotRepeated) {
  ModbusHead head(config_for(server), *parse_modbus_endpoint(server.endpoint()));
  ASSERT_TRUE(head.connect());
  ASSERT_TRUE(head.start_move({1, 1}));  // the command register is known to be clear now
  server.misbehave({{Kind::doubled, {}, 0}});
  ASSERT_TRUE(in_time([&] { return head.status(); }));
  const auto before = server.writes_to(0x000).size();
  // Parameters arrive; the acknowledgement of START gets lost.
  server.misbehave({{Kind::late, std::chrono::milliseconds(0), 0}, {Kind::silence, {}, 0}});
  ASSERT_TRUE(in_time([&] { return head.start_move({2, 2}); }));
  const auto writes = server.writes_to(0x000);
  EXPECT_EQ(std::count(writes.begin() + static_cast<std::ptrdiff_t>(before), writes.end(), 8), 1);
}

TEST_F(ModbusTcp, StopReachesTheSecondAxisWhenTheFirstRefuses) {
  ModbusHead head(config_for(server), *parse_modbus_endpoint(server.endpoint()));
  ASSERT_TRUE(head.connect());
  server.misbehave({{Kind::exception, {}, 4}});
  EXPECT_FALSE(in_time([&] { return head.stop(); }));
  EXPECT_EQ(server.writes_to(0x100), (std::vector<std::uint16_t>{0, 32, 0}));
}

TEST_F(ModbusTcp, SoftLimitsWatchdogHomingAndReset) {
  server.set_register(0x12, 0xFFC7);  // -3700000
  server.set_register(0x13, 0x8AE0);
  server.set_register(0x14, 0x0038);  // 3700000
  server.set_register(0x15, 0x7520);
  ModbusHead head(config_for(server), *parse_modbus_endpoint(server.endpoint()));
  ASSERT_TRUE(head.connect());
  const auto limits = head.soft_limits();
  ASSERT_TRUE(limits);
  EXPECT_DOUBLE_EQ(limits->lower.delta_deg, -370);
  EXPECT_DOUBLE_EQ(limits->upper.delta_deg, 370);
  ASSERT_TRUE(head.arm_watchdog(std::chrono::milliseconds(3000)));
  EXPECT_EQ(server.get_register(0x10), 3000);
  EXPECT_EQ(server.get_register(0x110), 3000);
  ASSERT_TRUE(head.start_homing());
  ASSERT_TRUE(head.reset_alarm());
  EXPECT_EQ(server.writes_to(0x100), (std::vector<std::uint16_t>{0, 16, 0, 128, 0}));
  EXPECT_FALSE(head.arm_watchdog(std::chrono::milliseconds(70000)));
}

}  // namespace
}  // namespace plumbline::rig

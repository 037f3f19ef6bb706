// The simulated drive over real wires: libmodbus clients over TCP and over a pseudo terminal.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/sim/wire_rig.h"

namespace plumbline::sim {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::StartsWith;

class WireModbus : public ::testing::TestWithParam<const char*> {
 protected:
  std::string serve(WireRig& rig) {
    return std::string(GetParam()) == "tcp" ? rig.serve_tcp() : rig.serve_rtu();
  }
};

INSTANTIATE_TEST_SUITE_P(Carriers, WireModbus, ::testing::Values("tcp", "rtu"),
                         [](const auto& parameter) { return std::string(parameter.param); });

TEST_P(WireModbus, HomesMovesAndConfirms) {
  WireRig rig;
  ModbusClient client(serve(rig));
  for (const int base : {kDelta, kTilt}) {
    EXPECT_FALSE(client.bit(base, 4));
    client.pulse(base, 1u << 4);
    EXPECT_TRUE(eventually([&] { return client.bit(base, 4); }));
    EXPECT_NEAR(client.read32(base + 0x22), 0, 52);
  }
  client.move(kDelta, -1234567, 41);
  client.move(kTilt, 800000, 42);
  for (const int base : {kDelta, kTilt}) {
    EXPECT_TRUE(eventually([&] { return client.bit(base, 14); }));
    EXPECT_FALSE(client.bit(base, 13));
  }
  EXPECT_EQ(client.read32(kDelta + 0x26), -1234567);
  EXPECT_EQ(client.read16(kDelta + 0x2A), 41);
  EXPECT_NEAR(client.read32(kDelta + 0x22), -1234567, 52);
  EXPECT_EQ(client.read32(kTilt + 0x26), 800000);
  EXPECT_EQ(client.read16(kTilt + 0x2A), 42);
  EXPECT_NEAR(client.read32(kTilt + 0x22), 800000, 52);
}

TEST_P(WireModbus, SoftLimitAlarmAndReset) {
  WireRig rig;
  ModbusClient client(serve(rig));
  client.move(kTilt, 2000000, 9);
  EXPECT_EQ(client.read16(kTilt + 0x21), 0x66);
  EXPECT_TRUE(client.bit(kTilt, 7));
  EXPECT_EQ(client.read16(kTilt + 0x2A), 0);
  client.pulse(kTilt, 1u << 7);
  EXPECT_EQ(client.read16(kTilt + 0x21), 0);
}

TEST_P(WireModbus, StopEndsAMoveOnTheWay) {
  WireRig rig({}, 1);
  ModbusClient client(serve(rig));
  client.move(kDelta, 3600000, 1);
  EXPECT_TRUE(eventually([&] { return client.read32(kDelta + 0x28) > 100000; }));
  client.pulse(kDelta, 1u << 5);
  EXPECT_TRUE(eventually([&] { return !client.bit(kDelta, 13); }));
  EXPECT_FALSE(client.bit(kDelta, 14));
  EXPECT_LT(client.read32(kDelta + 0x22), 3000000);
}

TEST_P(WireModbus, WatchdogStopsASilentHostsMotors) {
  WireRig rig({}, 1);
  ModbusClient client(serve(rig));
  client.write(kDelta + 0x10, {300});
  client.move(kDelta, 3600000, 1);
  std::this_thread::sleep_for(std::chrono::milliseconds(900));
  EXPECT_EQ(client.read16(kDelta + 0x21), 0x84);
  EXPECT_TRUE(eventually([&] { return !client.bit(kDelta, 13); }));
  EXPECT_FALSE(client.bit(kDelta, 5));
  EXPECT_LT(client.read32(kDelta + 0x22), 3000000);
}

TEST_P(WireModbus, RefusesWithStandardExceptions) {
  WireRig rig;
  ModbusClient client(serve(rig));
  std::uint8_t coil = 0;
  EXPECT_EQ(modbus_read_bits(client.get(), 0, 1, &coil), -1);
  EXPECT_EQ(errno, EMBXILFUN);
  EXPECT_EQ(client.try_read(0x2D, 1), EMBXILADD);
  EXPECT_EQ(client.try_read(0x00, 0x2E), EMBXILADD);
  EXPECT_EQ(client.try_read(0x5000, 2), EMBXILADD);
  EXPECT_EQ(client.try_write(0x20, {1}), EMBXILADD);
  EXPECT_EQ(client.try_write(0x0A, {5}), EMBXILVAL);
  EXPECT_EQ(modbus_write_register(client.get(), 0x0B, 17), 1) << "FC06";
  EXPECT_EQ(client.read16(0x0B), 17);
}

TEST_P(WireModbus, AnotherUnitIdMeetsSilence) {
  WireRig rig;
  const std::string endpoint = serve(rig);
  {
    ModbusClient stranger(endpoint, 2);
    stranger.set_timeout_ms(200);
    EXPECT_EQ(stranger.try_read(0x20, 2), ETIMEDOUT);
  }
  ModbusClient client(endpoint);
  EXPECT_EQ(client.try_read(0x20, 2), 0);
}

TEST_P(WireModbus, SecondClientFindsWhatTheFirstLeft) {
  WireRig rig;
  const std::string endpoint = serve(rig);
  { ModbusClient(endpoint).write(kDelta + 0x0B, {77}); }
  EXPECT_EQ(ModbusClient(endpoint).read16(kDelta + 0x0B), 77);
}

// Unit 1, FC03, 2 registers from 20h: ENABLED | READY | IN POSITION = 4021h, no alarm.
TEST(WireModbusBytes, TcpRequestAndReply) {
  WireRig rig;
  RawBytes raw(rig.serve_tcp());
  raw.send({0xAB, 0xCD, 0, 0, 0, 6, 1, 3, 0x00, 0x20, 0, 2});
  EXPECT_THAT(raw.receive(13), ElementsAre(0xAB, 0xCD, 0, 0, 0, 7, 1, 3, 4, 0x40, 0x21, 0, 0));
}

TEST(WireModbusBytes, RtuRequestAndReply) {
  WireRig rig;
  RawBytes raw(rig.serve_rtu());
  raw.send({1, 3, 0x00, 0x20, 0, 2, 0xC5, 0xC1});
  EXPECT_THAT(raw.receive(9), ElementsAre(1, 3, 4, 0x40, 0x21, 0, 0, 0xBF, 0xF9));
  raw.send({1, 3, 0x00, 0x20, 0, 2, 0xC5, 0xC2});  // wrong CRC: no answer
  EXPECT_THAT(raw.receive(1, 300), ElementsAre());
  raw.send({1, 3, 0x00, 0x20, 0, 2, 0xC5, 0xC1});
  EXPECT_EQ(raw.receive(9).size(), 9u);
}

// Byte count 2 for two registers: value error, and nothing is stored.
TEST(WireModbusBytes, ContradictoryWriteIsRefused) {
  WireRig rig;
  const std::string endpoint = rig.serve_tcp();
  RawBytes raw(endpoint);
  raw.send({0, 1, 0, 0, 0, 9, 1, 0x10, 0x00, 0x0A, 0, 2, 2, 0, 2});
  EXPECT_THAT(raw.receive(9), ElementsAre(0, 1, 0, 0, 0, 3, 1, 0x90, 3));
  EXPECT_EQ(ModbusClient(endpoint).read16(0x0A), 1);
}

TEST(WireModbusBytes, HalfARequestDoesNotHoldUpOthers) {
  WireRig rig;
  const std::string endpoint = rig.serve_tcp();
  RawBytes half(endpoint);
  half.send({0, 1, 0, 0, 0, 6, 1});
  ModbusClient client(endpoint);
  EXPECT_EQ(client.try_read(0x20, 13), 0);
}

/// The reply to reading 20h and 21h in a world with one fault, raw.
std::vector<int> reply_under(const Fault& fault, const char* carrier, std::size_t bytes,
                             int patience_ms = 5000) {
  WireRig rig({.all = {fault}});
  const bool tcp = std::string(carrier) == "tcp";
  RawBytes raw(tcp ? rig.serve_tcp() : rig.serve_rtu());
  if (tcp) {
    raw.send({0x10, 0x20, 0, 0, 0, 6, 1, 3, 0x00, 0x20, 0, 2});
  } else {
    raw.send({1, 3, 0x00, 0x20, 0, 2, 0xC5, 0xC1});
  }
  return raw.receive(bytes, patience_ms);
}

TEST(WireModbusFaults, Exception) {
  const Fault fault{.kind = FaultKind::modbus_exception, .value = 4};
  EXPECT_THAT(reply_under(fault, "tcp", 9), ElementsAre(0x10, 0x20, 0, 0, 0, 3, 1, 0x83, 4));
  EXPECT_THAT(reply_under(fault, "rtu", 5), ElementsAre(1, 0x83, 4, 0x40, 0xF3));
}

TEST(WireModbusFaults, WrongUnit) {
  const Fault fault{.kind = FaultKind::modbus_wrong_unit};
  EXPECT_THAT(reply_under(fault, "tcp", 13),
              ElementsAre(0x10, 0x20, 0, 0, 0, 7, 2, 3, 4, 0x40, 0x21, 0, 0));
  EXPECT_THAT(reply_under(fault, "rtu", 9), ElementsAre(2, 3, 4, 0x40, 0x21, 0, 0, 0x8C, 0xF9))
      << "with a CRC that fits";
}

TEST(WireModbusFaults, WrongTransaction) {
  EXPECT_THAT(reply_under({.kind = FaultKind::modbus_wrong_transaction}, "tcp", 13),
              ElementsAre(0x10, 0x21, 0, 0, 0, 7, 1, 3, 4, 0x40, 0x21, 0, 0));
}

TEST(WireModbusFaults, BadCrc) {
  EXPECT_THAT(reply_under({.kind = FaultKind::modbus_bad_crc}, "rtu", 9),
              ElementsAre(1, 3, 4, 0x40, 0x21, 0, 0, 0xBF, 0xF9 ^ 0x55));
}

TEST(WireModbusFaults, Truncated) {
  const Fault fault{.kind = FaultKind::modbus_truncated, .value = 3};
  EXPECT_THAT(reply_under(fault, "tcp", 13, 300), ElementsAre(0x10, 0x20, 0));
  EXPECT_THAT(reply_under(fault, "rtu", 9, 300), ElementsAre(1, 3, 4));
}

TEST(WireModbusFaults, SilenceIsForTheCountedRequestsAndNotCarriedOut) {
  WireRig rig({.all = {{.kind = FaultKind::modbus_silence, .after = 1, .count = 2}}});
  ModbusClient client(rig.serve_rtu());
  EXPECT_EQ(client.try_read(0x20, 2), 0);
  client.set_timeout_ms(150);
  EXPECT_EQ(client.try_write(0x0B, {5}), ETIMEDOUT);
  EXPECT_EQ(client.try_read(0x20, 2), ETIMEDOUT);
  client.set_timeout_ms(5000);
  EXPECT_EQ(client.read16(0x0B), 0);
}

TEST(WireModbusFaults, LateReplyComesForTheNextRequest) {
  WireRig rig({.all = {{.kind = FaultKind::modbus_late, .value = 0.6}}});
  ModbusClient client(rig.serve_tcp());
  client.set_timeout_ms(100);
  EXPECT_EQ(client.try_read(0x20, 2), ETIMEDOUT);
  client.set_timeout_ms(5000);
  EXPECT_EQ(client.try_read(0x20, 2), EMBBADDATA) << "the transaction id is that of the first";
}

TEST(WireModbusFaults, Reset) {
  WireRig rig({.all = {{.kind = FaultKind::modbus_reset}}});
  RawBytes raw(rig.serve_tcp());
  raw.send({0, 1, 0, 0, 0, 6, 1, 3, 0x00, 0x20, 0, 2});
  EXPECT_TRUE(raw.receive(1).empty());
  EXPECT_TRUE(raw.reset());
}

TEST(WireModbusFaults, HalfOpenStaysOpenAndDumbWhileOthersAreServed) {
  WireRig rig({.all = {{.kind = FaultKind::modbus_half_open}}});
  const std::string endpoint = rig.serve_tcp();
  RawBytes raw(endpoint);
  const std::vector<std::uint8_t> request = {0, 1, 0, 0, 0, 6, 1, 3, 0x00, 0x20, 0, 2};
  raw.send(request);
  EXPECT_TRUE(raw.receive(1, 200).empty());
  raw.send(request);
  EXPECT_TRUE(raw.receive(1, 200).empty());
  EXPECT_FALSE(raw.closed() || raw.reset());
  EXPECT_EQ(ModbusClient(endpoint).try_read(0x20, 2), 0);
}

TEST(WireModbusAddress, EndpointsAreReal) {
  WireRig rig;
  EXPECT_THAT(rig.serve_tcp(), StartsWith("tcp:127.0.0.1:"));
  EXPECT_THAT(rig.modbus->endpoint(), ::testing::Not(StartsWith("tcp:127.0.0.1:0")));
  const std::string link = rig.directory.file("tty");
  EXPECT_EQ(rig.serve_rtu(), "rtu:" + link + ",115200,8N1");
  EXPECT_TRUE(std::filesystem::is_symlink(link));
  rig.modbus.reset();
  EXPECT_FALSE(std::filesystem::exists(std::filesystem::symlink_status(link)));
}

TEST(WireModbusAddress, LinkOfAKilledRigIsReplacedAFileIsNot) {
  WireRig rig;
  const std::string link = rig.directory.file("tty");
  std::filesystem::create_symlink("/nonexistent", link);
  EXPECT_EQ(rig.serve_rtu(), "rtu:" + link + ",115200,8N1");
  const std::string file = rig.directory.file("precious");
  std::filesystem::create_directory(file);
  auto refused = ModbusServer::open("rtu:" + file, 1, rig.machine, {}, 1);
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().code, ErrorCode::rig);
  EXPECT_TRUE(std::filesystem::exists(file));
}

TEST(WireModbusAddress, ALineThatAKilledClientHasLeftAsItWasCanBeOpenedAgain) {
  WireRig rig;
  const std::string endpoint = rig.serve_rtu();
  const ModbusClient killed(endpoint);  // has not set the line back
  ModbusClient next(endpoint);
  EXPECT_EQ(next.try_read(0x20, 2), 0);
}

TEST(WireModbusAddress, WhatCannotBeHadIsRefusedInOneLine) {
  WireRig rig;
  const std::string taken = rig.serve_tcp();
  const auto error = [&](const std::string& address) {
    auto server = ModbusServer::open(address, 1, rig.machine, {}, 1);
    EXPECT_FALSE(server.has_value()) << address;
    return server ? Error{} : server.error();
  };
  for (const char* wrong : {"udp:1", "tcp:", "tcp:127.0.0.1", "tcp:127.0.0.1:", "tcp:localhost:1",
                            "tcp:127.0.0.1:70000", "tcp:127.0.0.1:5x", "rtu:"}) {
    EXPECT_EQ(error(wrong).code, ErrorCode::input) << wrong;
    EXPECT_THAT(error(wrong).message, HasSubstr(wrong));
  }
  EXPECT_EQ(error(taken).code, ErrorCode::rig);
  EXPECT_THAT(error(taken).message, HasSubstr("in use"));
}

}  // namespace
}  // namespace plumbline::sim

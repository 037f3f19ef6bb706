#include "rig/rig_config.h"

#include <gtest/gtest.h>

#include "rig/modbus_link.h"

namespace plumbline::rig {
namespace {

TEST(RigConfig, HeadIsReadWhole) {
  auto file = StrictFile::parse(R"(
modbus = "rtu:/dev/ttyUSB0,57600,8N2"
axis_unit_id = [3, 4]
axis_base = [0, 0]
word_order = "low_first"
counts_per_deg = [10000, -20000.5]
speed_deg_s = 20
acceleration_deg_s2 = 40
response_timeout_ms = 700
poll_interval_ms = 15
watchdog_ms = 2500
)",
                                "rig.toml");
  ASSERT_TRUE(file);
  StrictTable root = file->root();
  const auto head = read_head_config(root);
  ASSERT_TRUE(head);
  ASSERT_TRUE(file->finish()) << file->finish().error().message;
  EXPECT_EQ(head->unit_id, (std::array<int, 2>{3, 4}));
  EXPECT_EQ(head->axis_base, (std::array<int, 2>{0, 0}));
  EXPECT_EQ(head->registers.word_order, WordOrder::low_first);
  EXPECT_DOUBLE_EQ(head->counts_per_deg[1], -20000.5);
  EXPECT_EQ(head->response_timeout.count(), 700);
  EXPECT_EQ(head->poll_interval.count(), 15);
  EXPECT_EQ(head->watchdog.count(), 2500);
}

std::string refusal(const char* text, bool sensor) {
  auto file = StrictFile::parse(text, "rig.toml");
  StrictTable root = file->root();
  if (sensor) {
    EXPECT_TRUE(read_sensor_config(root));
  } else {
    EXPECT_TRUE(read_head_config(root));
  }
  const auto done = file->finish();
  return done ? "" : done.error().message;
}

TEST(RigConfig, ContradictionsAndUnknownKeysAreRefused) {
  EXPECT_EQ(refusal("axis_base = [0, 0]\n", false),
            "rig.toml:1:13: axis_base: both axes have the same unit id and the same registers");
  EXPECT_EQ(refusal("unitid = 2\n", false),
            "rig.toml:1:1: unknown key unitid; did you mean unit_id?");
  EXPECT_NE(refusal("modbus = \"udp:x\"\n", false).find("give tcp:HOST:PORT"), std::string::npos);
  EXPECT_NE(refusal("can = \"usb:0\"\n", true).find("give can:INTERFACE"), std::string::npos);
  EXPECT_NE(refusal("min_V = 5\nmax_V = -5\n", true).find("must be above min_V"),
            std::string::npos);
  EXPECT_NE(refusal("[signals]\nxx = \"A.B\"\n", true).find("unknown key signals.xx"),
            std::string::npos);
}

TEST(RigConfig, SensorIsReadWholeAndTakesItsConverterFromAdc) {
  auto file = StrictFile::parse(R"(
can = "can:can0"
rate_hz = 250
bits = 20
[signals]
x = "ACC_A.Y"
crc = ""
[covariates]
rh_pct = "ENV.Humidity"
supply_V = "ENV.Supply"
)",
                                "rig.toml");
  ASSERT_TRUE(file);
  StrictTable root = file->root();
  const auto sensor = read_sensor_config(root, Adc{12, -4, 1});
  ASSERT_TRUE(sensor);
  ASSERT_TRUE(file->finish()) << file->finish().error().message;
  EXPECT_EQ(sensor->adc.bits, 20);
  EXPECT_DOUBLE_EQ(sensor->adc.min_V, -4);
  EXPECT_DOUBLE_EQ(sensor->adc.max_V, 1);
  EXPECT_EQ(sensor->signals.x, "ACC_A.Y");
  EXPECT_EQ(sensor->signals.y, "ACC_A.Y");
  EXPECT_EQ(sensor->signals.crc, "");
  ASSERT_EQ(sensor->covariates.size(), 2u);
  EXPECT_EQ(sensor->covariates[0].column, "rh_pct");
  EXPECT_EQ(sensor->covariates[0].signal, "ENV.Humidity");
}

TEST(RigConfig, MissingAddressesAndFilesAreNamed) {
  EXPECT_EQ(make_dividing_head({}).error().code, ErrorCode::input);
  EXPECT_EQ(make_sample_source({}).error().code, ErrorCode::input);
  SensorConfig sensor;
  sensor.can = "can:can0";
  sensor.dbc_file = "/nonexistent/x.dbc";
  EXPECT_EQ(make_sample_source(sensor).error().message,
            "/nonexistent/x.dbc: cannot read the DBC file");
}

TEST(ModbusEndpoint, IsTakenApart) {
  const auto tcp = parse_modbus_endpoint("tcp:head.local:1502");
  ASSERT_TRUE(tcp);
  EXPECT_EQ(tcp->host, "head.local");
  EXPECT_EQ(tcp->port, "1502");
  EXPECT_EQ(parse_modbus_endpoint("tcp:[::1]:502")->host, "::1");
  const auto rtu = parse_modbus_endpoint("rtu:/dev/ttyS0,9600,7O2");
  ASSERT_TRUE(rtu);
  EXPECT_EQ(rtu->device, "/dev/ttyS0");
  EXPECT_EQ(rtu->baud, 9600);
  EXPECT_EQ(rtu->data_bits, 7);
  EXPECT_EQ(rtu->parity, 'O');
  EXPECT_EQ(rtu->stop_bits, 2);
  EXPECT_EQ(parse_modbus_endpoint("rtu:/dev/ttyS0")->parity, 'E');
  for (const char* wrong : {"", "tcp:", "tcp:host", "tcp::502", "tcp:host:0", "tcp:host:99999",
                            "tcp:host:5x", "rtu:", "rtu:/dev/x,fast", "rtu:/dev/x,9600,9E1",
                            "rtu:/dev/x,9600,8E1,x", "serial:/dev/x"}) {
    EXPECT_FALSE(parse_modbus_endpoint(wrong)) << wrong;
  }
}

TEST(Alarm, TextNamesTheCode) {
  EXPECT_EQ(alarm_text(0x10), "10h following error");
  EXPECT_EQ(alarm_text(0x84), "84h communication");
  EXPECT_EQ(alarm_text(0x99), "99h unknown alarm");
}

}  // namespace
}  // namespace plumbline::rig

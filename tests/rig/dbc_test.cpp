#include "rig/dbc.h"

#include <gtest/gtest.h>

namespace plumbline::rig {
namespace {

using Bytes = std::vector<std::uint8_t>;

TEST(Dbc, DefaultLayoutParses) {
  const auto dbc = parse_dbc(default_dbc_text(), "plumbline.dbc");
  ASSERT_TRUE(dbc) << dbc.error().message;
  ASSERT_EQ(dbc->messages.size(), 4u);
  EXPECT_EQ(dbc->messages[0].id, 416u);
  EXPECT_EQ(dbc->messages[0].name, "ACC_A");
  const DbcSignal* temp = dbc->find("ACC_B")->find("Temp");
  ASSERT_NE(temp, nullptr);
  EXPECT_EQ(temp->unit, "degC");
  EXPECT_TRUE(temp->is_signed);
  EXPECT_DOUBLE_EQ(temp->factor, 0.01);
}

TEST(Dbc, SignalsWithoutRangeUnitAndReceiversAreTaken) {
  const auto dbc = parse_dbc(
      "BO_ 416 ACC_A: 8 NODE\n SG_ X : 16|24@1- (1,0)\n SG_ Y : 40|24@1- (1,0)\n", "n.dbc");
  ASSERT_TRUE(dbc) << dbc.error().message;
  EXPECT_EQ(dbc->messages[0].signals.size(), 2u);
}

TEST(Dbc, OtherStatementsAreSkipped) {
  const auto dbc = parse_dbc(
      "VERSION \"x\"\nNS_ :\n\tCM_\n\tBA_\n\nBS_:\n\nBU_: A B\n"
      "BO_ 2147484064 E: 8 A\n SG_ S : 7|16@0+ (1e-3,-40.5) [-1E+05|1] \"V\" B,C\n"
      "CM_ SG_ 416 S \"two\nlines ; with BO_ 1 X: 8 N\n\";\nBA_DEF_ BO_ \"Cycle\" INT 0 10;\n"
      "VAL_ 416 S 0 \"off\" 1 \"on\" ;\n",
      "n.dbc");
  ASSERT_TRUE(dbc) << dbc.error().message;
  ASSERT_EQ(dbc->messages.size(), 1u);
  EXPECT_TRUE(dbc->messages[0].extended);
  EXPECT_EQ(dbc->messages[0].id, 416u);
  const DbcSignal& signal = dbc->messages[0].signals.at(0);
  EXPECT_DOUBLE_EQ(signal.factor, 1e-3);
  EXPECT_DOUBLE_EQ(signal.offset, -40.5);
}

DbcSignal signal(int start, int length, bool little, bool is_signed) {
  DbcSignal s;
  s.start_bit = start;
  s.length = length;
  s.little_endian = little;
  s.is_signed = is_signed;
  return s;
}

TEST(Dbc, LittleEndianBits) {
  const Bytes data = {0x01, 0x02, 0xFE, 0xFF, 0xFF, 0x56, 0x34, 0x12};
  EXPECT_EQ(signal(0, 8, true, false).raw(data), 1);
  EXPECT_EQ(signal(16, 24, true, true).raw(data), -2);
  EXPECT_EQ(signal(40, 24, true, true).raw(data), 0x123456);
  EXPECT_EQ(signal(4, 8, true, false).raw(data), 0x20);
  EXPECT_EQ(signal(60, 8, true, false).raw(data), std::nullopt);
}

TEST(Dbc, BigEndianBits) {
  const Bytes data = {0x12, 0x34, 0x56, 0xFF, 0x80, 0, 0, 0};
  EXPECT_EQ(signal(7, 16, false, false).raw(data), 0x1234);
  EXPECT_EQ(signal(3, 8, false, false).raw(data), 0x23);
  EXPECT_EQ(signal(31, 9, false, true).raw(data), -1);
  EXPECT_EQ(signal(63, 16, false, false).raw(data), std::nullopt);
}

TEST(Dbc, WholeSixtyFourBits) {
  const Bytes data = {0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF};
  EXPECT_EQ(signal(0, 64, true, true).raw(data), -1);
  EXPECT_DOUBLE_EQ(*signal(0, 64, true, false).physical(data), 18446744073709551615.0);
}

TEST(Dbc, ErrorsNameFileLineAndReason) {
  const auto message = [](const char* text) {
    const auto dbc = parse_dbc(text, "n.dbc");
    return dbc ? std::string() : dbc.error().message;
  };
  EXPECT_EQ(message("\nSG_ X : 0|8@1+ (1,0)\n"), "n.dbc:2: SG_ before the first BO_");
  EXPECT_EQ(message("BQ_ 1 A: 8 N\n"), "n.dbc:1: unknown statement BQ_; did you mean BO_?");
  EXPECT_EQ(message("BO_ 1 A: 8 N\n SG_ X : 60|8@1+ (1,0)\n"),
            "n.dbc:2: signal A.X reaches byte 8, but the message has 8 bytes");
  EXPECT_EQ(message("BO_ 1 A: 8 N\n SG_ X : 0|8@2+ (1,0)\n"),
            "n.dbc:2: the byte order 2 is not a whole number 0 … 1");
  EXPECT_EQ(message("BO_ 1 A: 8 N\n SG_ X : 0|0@1+ (1,0)\n"),
            "n.dbc:2: the length in bits 0 is not a whole number 1 … 64");
  EXPECT_EQ(message("BO_ 1 A: 8 N\n SG_ X : 0|8@1+ (1 0)\n"), "n.dbc:2: ',' expected, not \"0\"");
  EXPECT_EQ(message("BO_ 1 A: 8 N\n SG_ X : 0|8@1+ (1,"),
            "n.dbc:2: the offset expected, but the file ends");
  EXPECT_EQ(message("BO_ 1 A: 8 N\n SG_ X m0 : 0|8@1+ (1,0)\n"),
            "n.dbc:2: signal X is multiplexed, which is not supported");
  EXPECT_EQ(message("BO_ 1 A: 8 N\nBO_ 2 A: 8 N\n"), "n.dbc:2: message A stands twice");
  EXPECT_EQ(message("BO_ 1 A: 8 N\n SG_ X : 0|8@1+ (1,0)\n SG_ X : 8|8@1+ (1,0)\n"),
            "n.dbc:3: signal A.X stands twice");
  EXPECT_EQ(message("CM_ \"no end"), "n.dbc:1: ';' expected, but the file ends");
}

TEST(Dbc, AnyCutOfTheDefaultLayoutIsParsedOrRefused) {
  const std::string_view text = default_dbc_text();
  int refused = 0;
  for (std::size_t length = 0; length < text.size(); ++length) {
    const auto dbc = parse_dbc(text.substr(0, length), "n.dbc");
    if (!dbc) {
      ++refused;
      EXPECT_TRUE(dbc.error().message.starts_with("n.dbc:"));
    }
  }
  EXPECT_GT(refused, 500);
}

}  // namespace
}  // namespace plumbline::rig

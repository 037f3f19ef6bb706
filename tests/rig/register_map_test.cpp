#include "rig/register_map.h"

#include <gtest/gtest.h>

#include "rig/modbus_frame.h"

namespace plumbline::rig {
namespace {

using Bytes = std::vector<std::uint8_t>;
using Words = std::vector<std::uint16_t>;

TEST(RegisterMap, SplitsAndJoinsInBothOrders) {
  const auto high = split_words(WordOrder::high_first, 0x12345678);
  EXPECT_EQ(high, (std::array<std::uint16_t, 2>{0x1234, 0x5678}));
  const auto low = split_words(WordOrder::low_first, 0x12345678);
  EXPECT_EQ(low, (std::array<std::uint16_t, 2>{0x5678, 0x1234}));
  EXPECT_EQ(join_words(WordOrder::high_first, 0xFFFF, 0xFFFE), 0xFFFFFFFEu);
  EXPECT_EQ(join_words(WordOrder::low_first, 0xFFFE, 0xFFFF), 0xFFFFFFFEu);
}

TEST(RegisterMap, AMoveIsOneBlockOfTenLiteralRegisters) {
  const MoveCommand move{-100000, 300000, 600000, 500000, 7};
  const auto writes = encode_move(RegisterMap{}, move);
  // -100000 = FFFE 7960, 300000 = 0004 93E0, 600000 = 0009 27C0, 500000 = 0007 A120
  const std::vector<RegisterWrite> expected = {
      {0x02, {0xFFFE, 0x7960, 0x0004, 0x93E0, 0x0009, 0x27C0, 0x0007, 0xA120, 0x0001, 0x0007}}};
  EXPECT_EQ(writes, expected);
}

TEST(RegisterMap, MovedRegistersMakeSeveralBlocks) {
  RegisterMap map;
  map.offset.sequence = 0x40;
  map.word_order = WordOrder::low_first;
  const auto writes = encode_move(map, {1, 2, 3, 4, 5});
  const std::vector<RegisterWrite> expected = {{0x02, {1, 0, 2, 0, 3, 0, 4, 0, 1}}, {0x40, {5}}};
  EXPECT_EQ(writes, expected);
}

TEST(RegisterMap, TheStatusBlockIs20hTo2Ch) {
  const RegisterBlock block = status_block(RegisterMap{});
  EXPECT_EQ(block.offset, 0x20);
  EXPECT_EQ(block.count, 13);
}

TEST(RegisterMap, DecodesALiteralStatusBlock) {
  // READY, IN POSITION, HOME END, ENABLED; alarm 28h; position -2; target echo 65536; sequence 9;
  // -1.5 °C
  const Words words = {0x4031, 0x0028, 0xFFFF, 0xFFFE, 0, 0, 0x0001, 0x0000, 0, 0, 9, 1, 0xFFF1};
  const AxisStatus status = decode_status(RegisterMap{}, words);
  EXPECT_TRUE(status.enabled);
  EXPECT_TRUE(status.homed);
  EXPECT_TRUE(status.ready);
  EXPECT_TRUE(status.in_position);
  EXPECT_FALSE(status.moving);
  EXPECT_FALSE(status.alarmed);
  EXPECT_EQ(status.alarm, 0x28);
  EXPECT_EQ(status.position, -2);
  EXPECT_EQ(status.target_echo, 65536);
  EXPECT_EQ(status.sequence_echo, 9);
  EXPECT_DOUBLE_EQ(status.temperature_C, -1.5);
  MoveCommand command;
  command.target = 65536;
  command.sequence = 9;
  EXPECT_TRUE(status.confirms(command));
  command.sequence = 8;
  EXPECT_FALSE(status.confirms(command));
}

TEST(RegisterMap, IsReadByName) {
  auto file = StrictFile::parse(
      "word_order = \"low_first\"\n[registers]\nstatus = 0x30\n[status_bits]\nready = 2\n"
      "[command_bits]\nstop = 6\n",
      "f.toml");
  ASSERT_TRUE(file);
  StrictTable root = file->root();
  const RegisterMap map = read_register_map(root);
  ASSERT_TRUE(file->finish()) << file->finish().error().message;
  EXPECT_EQ(map.word_order, WordOrder::low_first);
  EXPECT_EQ(map.offset.status, 0x30);
  EXPECT_EQ(map.status_bit.ready, 2);
  EXPECT_EQ(map.command_bit.stop, 6);
}

TEST(RegisterMap, UnknownNamesAndScatteredStatusAreRefused) {
  for (const auto& [text, part] :
       {std::pair{"[registers]\nstatsu = 1\n", "unknown key registers.statsu; did you mean status"},
        std::pair{"[registers]\nalarm = 1000\n", "within 125"},
        std::pair{"[status_bits]\nready = 16\n", "out of range"}}) {
    auto file = StrictFile::parse(text, "f.toml");
    ASSERT_TRUE(file);
    StrictTable root = file->root();
    read_register_map(root);
    const auto done = file->finish();
    ASSERT_FALSE(done) << text;
    EXPECT_NE(done.error().message.find(part), std::string::npos) << done.error().message;
  }
}

TEST(ModbusFrame, LiteralRequests) {
  EXPECT_EQ(read_request(1, 0x0120, 13), (Bytes{0x01, 0x03, 0x01, 0x20, 0x00, 0x0D}));
  EXPECT_EQ(write_request(17, 0x0001, Words{0x000A, 0x0102}),
            (Bytes{0x11, 0x10, 0x00, 0x01, 0x00, 0x02, 0x04, 0x00, 0x0A, 0x01, 0x02}));
  EXPECT_EQ(wrap_tcp(0x1234, Bytes{0x01, 0x03, 0, 0, 0, 1}),
            (Bytes{0x12, 0x34, 0, 0, 0, 6, 0x01, 0x03, 0, 0, 0, 1}));
}

TEST(ModbusFrame, AcceptsOnlyWhatFits) {
  EXPECT_EQ(*parse_read_reply(Bytes{1, 3, 4, 0x00, 0x06, 0xFF, 0xFE}, 1, 2),
            (Words{0x0006, 0xFFFE}));
  EXPECT_FALSE(parse_read_reply(Bytes{2, 3, 4, 0, 6, 0, 5}, 1, 2)) << "foreign unit";
  EXPECT_FALSE(parse_read_reply(Bytes{1, 4, 4, 0, 6, 0, 5}, 1, 2)) << "another function";
  EXPECT_FALSE(parse_read_reply(Bytes{1, 3, 2, 0, 6}, 1, 2)) << "another length";
  EXPECT_FALSE(parse_read_reply(Bytes{1, 3, 4, 0, 6, 0}, 1, 2)) << "truncated";
  EXPECT_FALSE(parse_read_reply(Bytes{}, 1, 2));
  EXPECT_TRUE(parse_write_reply(Bytes{1, 0x10, 0, 2, 0, 10}, 1, 2, 10));
  EXPECT_FALSE(parse_write_reply(Bytes{1, 0x10, 0, 2, 0, 9}, 1, 2, 10));
  EXPECT_FALSE(parse_write_reply(Bytes{1, 0x10, 0, 3, 0, 10}, 1, 2, 10));
  const auto refused = parse_read_reply(Bytes{1, 0x83, 2}, 1, 2);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().exception, 2);
  EXPECT_EQ(refused.error().text, "the drive refused: exception 2 (illegal data address)");
}

TEST(ModbusFrame, TcpHeaderIsChecked) {
  const Bytes right = {0x12, 0x34, 0, 0, 0, 5, 1, 3, 2, 0, 9};
  ASSERT_TRUE(unwrap_tcp(right, 0x1234));
  EXPECT_EQ(unwrap_tcp(right, 0x1234)->size(), 5u);
  EXPECT_FALSE(unwrap_tcp(right, 0x1235)) << "transaction";
  EXPECT_FALSE(unwrap_tcp(Bytes{0x12, 0x34, 0, 1, 0, 5, 1, 3, 2, 0, 9}, 0x1234)) << "protocol";
  EXPECT_FALSE(unwrap_tcp(Bytes{0x12, 0x34, 0, 0, 0, 6, 1, 3, 2, 0, 9}, 0x1234)) << "length";
}

}  // namespace
}  // namespace plumbline::rig

#include "rig/candump_log.h"

#include <gtest/gtest.h>

#include <cstring>

#include "rig/socket_receive.h"

namespace plumbline::rig {
namespace {

TEST(CandumpLine, ClassicFdExtendedErrorAndRemote) {
  auto frame = parse_candump_line("(1436509052.249713) can0 1A0#0102FF");
  ASSERT_TRUE(frame) << frame.error();
  EXPECT_EQ(frame->id, 0x1A0u);
  EXPECT_FALSE(frame->extended);
  ASSERT_EQ(frame->length, 3);
  EXPECT_EQ(frame->data[2], 0xFF);

  frame = parse_candump_line("(1.0) can0 000001A0#");
  ASSERT_TRUE(frame);
  EXPECT_TRUE(frame->extended);
  EXPECT_EQ(frame->length, 0);

  frame = parse_candump_line("(1.0) can0 1A0##1000102030405060708090A0B0C0D0E0F\r");
  ASSERT_TRUE(frame) << frame.error();
  EXPECT_EQ(frame->length, 16);
  EXPECT_EQ(frame->data[15], 0x0F);

  frame = parse_candump_line("(1.0) can0 20000040#0000000000000000");
  ASSERT_TRUE(frame);
  EXPECT_TRUE(frame->error);
  EXPECT_EQ(error_frame_text(*frame), "bus-off");

  frame = parse_candump_line("(1.0) can0 1A0#R8");
  ASSERT_TRUE(frame);
  EXPECT_TRUE(frame->remote);
}

TEST(CandumpLine, DamagedLinesAreRefused) {
  for (const char* line :
       {"", "can0 1A0#01", "(1.0) can0", "(1.0) can0 1A0", "(1.0) can0 1A#01", "(1.0) can0 1A0#0",
        "(1.0) can0 1A0#0G", "(1.0) can0 FFF#01", "(1.0) can0 1A0#010203040506070809",
        "(1.0) can0 1A0##", "(1.0) can0 XYZ#01"}) {
    EXPECT_FALSE(parse_candump_line(line)) << line;
  }
}

TEST(ErrorFrame, ControllerProblemsAreSpelledOut) {
  CanFrame frame;
  frame.error = true;
  frame.id = 0x004 | 0x020;
  frame.data[1] = 0x10;
  EXPECT_EQ(error_frame_text(frame), "no acknowledgement, receive error passive");
}

TEST(KernelFrame, LiteralBytes) {
  // struct can_frame: identifier in host order, length, 3 bytes, 8 data bytes
  std::vector<std::uint8_t> bytes(16, 0);
  const std::uint32_t id = 0x1A1;
  std::memcpy(bytes.data(), &id, 4);
  bytes[4] = 2;
  bytes[8] = 0xAB;
  bytes[9] = 0xCD;
  const auto frame = from_kernel_frame(bytes);
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->id, 417u);
  EXPECT_EQ(frame->length, 2);
  EXPECT_EQ(frame->data[1], 0xCD);
  bytes[4] = 9;
  EXPECT_FALSE(from_kernel_frame(bytes)) << "longer than the frame";
  bytes.pop_back();
  EXPECT_FALSE(from_kernel_frame(bytes)) << "cut";
}

TEST(Carrier, AddressesAreRefusedInOneLine) {
  EXPECT_EQ(make_carrier("usb:0").error().message,
            "can = \"usb:0\": give can:INTERFACE, unix:PATH or log:FILE");
  EXPECT_FALSE(make_carrier("can:"));
  EXPECT_FALSE(make_carrier(""));
}

TEST(Carrier, AbsentInterfaceIsNamed) {
  const auto carrier = make_carrier("can:nosuchcan");
  ASSERT_TRUE(carrier);
  const auto opened = (*carrier)->open();
  ASSERT_FALSE(opened);
  EXPECT_TRUE(opened.error().message.starts_with("can:nosuchcan: ")) << opened.error().message;
}

}  // namespace
}  // namespace plumbline::rig

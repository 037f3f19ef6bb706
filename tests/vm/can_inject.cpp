// Sends one CAN frame: can_inject IFACE CAN_ID_HEX [DATA_HEX]. With the flag bits of linux/can.h in
// the identifier it injects error frames (20000040: bus-off).
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>

int main(int argc, char** argv) {
  if (argc < 3) return 2;
  const int socket = ::socket(PF_CAN, SOCK_RAW, CAN_RAW);
  sockaddr_can name{};
  name.can_family = AF_CAN;
  name.can_ifindex = static_cast<int>(::if_nametoindex(argv[1]));
  if (socket < 0 || ::bind(socket, reinterpret_cast<sockaddr*>(&name), sizeof name) != 0) {
    std::perror(argv[1]);
    return 1;
  }
  can_frame frame{};
  frame.can_id = static_cast<canid_t>(std::strtoul(argv[2], nullptr, 16));
  frame.can_dlc = 8;
  const char* data = argc > 3 ? argv[3] : "";
  for (int i = 0; i < 8 && std::strlen(data) >= 2; ++i, data += 2) {
    const char byte[3] = {data[0], data[1], '\0'};
    frame.data[i] = static_cast<__u8>(std::strtoul(byte, nullptr, 16));
  }
  return ::write(socket, &frame, sizeof frame) == sizeof frame ? 0 : 1;
}

#include <gtest/gtest.h>
#include <linux/can.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "rig/acquisition.h"
#include "rig/rig_config.h"
#include "tests/rig/node_messages.h"

namespace plumbline::rig {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

/// A node at the far end of a real SOCK_SEQPACKET socket.
class Node {
 public:
  Node() {
    std::string name = (std::filesystem::temp_directory_path() / "plumbline-XXXXXX").string();
    folder_ = mkdtemp(name.data());
    listener_ = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strcpy(address.sun_path, path().c_str());
    EXPECT_EQ(bind(listener_, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
    EXPECT_EQ(listen(listener_, 4), 0);
  }
  ~Node() {
    hang_up();
    ::close(listener_);
    std::filesystem::remove_all(folder_);
  }
  Node(const Node&) = delete;
  Node& operator=(const Node&) = delete;

  std::string path() const { return folder_ + "/can"; }
  void accept_reader() { peer_ = accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC); }
  void hang_up() {
    if (peer_ >= 0) ::close(peer_);
    peer_ = -1;
  }
  void send(const CanFrame& frame) const {
    can_frame raw{};
    raw.can_id = frame.id | (frame.error ? CAN_ERR_FLAG : 0);
    raw.len = frame.length;
    std::copy_n(frame.data.begin(), 8, raw.data);
    send_bytes(&raw, sizeof raw);
  }
  void send_bytes(const void* bytes, std::size_t size) const {
    EXPECT_EQ(::send(peer_, bytes, size, MSG_NOSIGNAL), static_cast<ssize_t>(size));
  }
  void send(int counter) const {
    const auto frames = sample_frames(counter, counter, -counter, 7);
    send(frames.a);
    send(frames.b);
  }

 private:
  std::string folder_;
  int listener_ = -1;
  int peer_ = -1;
};

class CanSourceTest : public ::testing::Test {
 protected:
  void open(milliseconds silence = seconds(60)) {
    SensorConfig config;
    config.can = "unix:" + node.path();
    config.covariates = {{"rh_pct", "ENV.Humidity"}};
    config.silence_timeout = silence;
    auto made = make_sample_source(config);
    ASSERT_TRUE(made) << made.error().message;
    source = std::move(*made);
    const auto opened = source->open();
    ASSERT_TRUE(opened) << opened.error().message;
    node.accept_reader();
  }
  Node node;
  std::unique_ptr<SampleSource> source;
};

TEST_F(CanSourceTest, SamplesInOrderWithLossesCounted) {
  open();
  for (const int counter : {65533, 65534, 65535, 0, 1, 5, 5, 4, 6}) node.send(counter);
  auto bad = sample_frames(7, 1, 1, 1);
  bad.b.data[3] ^= 1;
  node.send(bad.a);
  node.send(bad.b);
  node.send(8);
  const auto batch = source->read(milliseconds(1000));
  ASSERT_TRUE(batch) << batch.error().message;
  std::vector<std::int64_t> counters;
  for (const RawSample& sample : batch->samples) counters.push_back(sample.counter);
  EXPECT_EQ(counters,
            (std::vector<std::int64_t>{65533, 65534, 65535, 65536, 65537, 65541, 65542, 65544}));
  EXPECT_DOUBLE_EQ(batch->samples.back().t_s, 0.11);
  const SourceStatistics statistics = source->statistics();
  EXPECT_EQ(statistics.frames, 22u);
  EXPECT_EQ(statistics.samples, 8u);
  EXPECT_EQ(statistics.lost_samples, 4u);
  EXPECT_EQ(statistics.crc_errors, 1u);
  EXPECT_EQ(statistics.out_of_order, 4u);
  EXPECT_GT(statistics.receive_buffer_bytes, 0u);
}

TEST_F(CanSourceTest, CovariatesCarryTheTimeOfTheLatestSample) {
  open();
  node.send(10);
  node.send(11);
  CanFrame environment;
  environment.id = 418;
  environment.length = 8;
  environment.data = {0x94, 0x11};
  node.send(environment);
  const auto batch = source->read(milliseconds(1000));
  ASSERT_TRUE(batch);
  ASSERT_EQ(batch->covariates.size(), 1u);
  EXPECT_EQ(batch->covariates[0].name, "rh_pct");
  EXPECT_DOUBLE_EQ(batch->covariates[0].value, 45.0);
  EXPECT_DOUBLE_EQ(batch->covariates[0].t_s, 0.01);
}

TEST_F(CanSourceTest, ErrorFramesAreCountedAndDescribed) {
  open();
  CanFrame error;
  error.error = true;
  error.id = 0x40;
  error.length = 8;
  node.send(error);
  node.send(1);
  ASSERT_EQ(source->read(milliseconds(1000))->samples.size(), 1u);
  EXPECT_EQ(source->statistics().error_frames, 1u);
  EXPECT_EQ(source->statistics().last_error_frame, "bus-off");
}

TEST_F(CanSourceTest, SilenceGetsAClearMessageAndReadingMayGoOn) {
  open(milliseconds(100));
  Result<SampleBatch> batch;
  for (int i = 0; i < 100 && batch; ++i) batch = source->read(milliseconds(20));
  ASSERT_FALSE(batch);
  EXPECT_EQ(batch.error().code, ErrorCode::rig);
  EXPECT_EQ(batch.error().message,
            "unix:" + node.path() +
                ": no sample for 0.1 s (0 frames so far): is the node powered, is the bus "
                "connected, does the DBC file fit?");
  node.send(1);
  EXPECT_EQ(source->read(milliseconds(1000))->samples.size(), 1u);
}

TEST_F(CanSourceTest, HangUpIsReportedAfterTheData) {
  open();
  node.send(1);
  node.hang_up();
  const auto batch = source->read(milliseconds(1000));
  ASSERT_TRUE(batch);
  EXPECT_EQ(batch->samples.size(), 1u);
  const auto failed = source->read(milliseconds(1000));
  ASSERT_FALSE(failed);
  EXPECT_EQ(failed.error().message, "unix:" + node.path() + ": the node has closed the connection");
}

TEST_F(CanSourceTest, ReopenedSourceKeepsItsClock) {
  open();
  node.send(1);
  node.hang_up();
  ASSERT_TRUE(source->read(milliseconds(1000)));
  ASSERT_FALSE(source->read(milliseconds(1000)));
  ASSERT_TRUE(source->open());
  node.accept_reader();
  node.send(11);
  const auto batch = source->read(milliseconds(1000));
  ASSERT_TRUE(batch);
  ASSERT_EQ(batch->samples.size(), 1u);
  EXPECT_DOUBLE_EQ(batch->samples[0].t_s, 0.1);
  EXPECT_EQ(source->statistics().lost_samples, 9u);
}

TEST_F(CanSourceTest, ForeignMessagesAreRefused) {
  open();
  node.send_bytes("hello", 5);
  EXPECT_EQ(source->read(milliseconds(1000)).error().message,
            "unix:" + node.path() + ": a message of 5 bytes is no CAN frame");
}

TEST_F(CanSourceTest, AcquisitionDeliversAllAndThenTheFailure) {
  open();
  node.hang_up();
  Acquisition acquisition(std::move(source));
  ASSERT_TRUE(acquisition.start());
  node.accept_reader();
  constexpr int kSamples = 500;
  std::thread sender([this] {
    for (int counter = 0; counter < kSamples; ++counter) node.send(counter);
    node.hang_up();
  });
  std::size_t got = 0;
  Result<SampleBatch> batch;
  const auto deadline = std::chrono::steady_clock::now() + seconds(30);
  while (batch && std::chrono::steady_clock::now() < deadline) {
    batch = acquisition.take(milliseconds(100));
    if (batch) got += batch->samples.size();
  }
  sender.join();
  EXPECT_EQ(got, static_cast<std::size_t>(kSamples));
  ASSERT_FALSE(batch);
  EXPECT_NE(batch.error().message.find("closed the connection"), std::string::npos);
  EXPECT_EQ(acquisition.statistics().lost_samples, 0u);
}

TEST_F(CanSourceTest, AcquisitionCountsWhatItsQueueCannotHold) {
  open();
  node.hang_up();
  Acquisition acquisition(std::move(source), 10);
  ASSERT_TRUE(acquisition.start());
  node.accept_reader();
  for (int counter = 0; counter < 60; ++counter) node.send(counter);
  const auto deadline = std::chrono::steady_clock::now() + seconds(30);
  while (acquisition.statistics().samples < 60 && std::chrono::steady_clock::now() < deadline) {
    std::this_thread::sleep_for(milliseconds(5));
  }
  const auto batch = acquisition.take(milliseconds(1000));
  ASSERT_TRUE(batch);
  EXPECT_EQ(batch->samples.size(), 10u);
  EXPECT_EQ(acquisition.statistics().queue_drops, 50u);
  acquisition.discard();
  EXPECT_TRUE(acquisition.take(milliseconds(0))->samples.empty());
  acquisition.stop();
}

TEST(CanSourceAbsent, NobodyListeningIsNamed) {
  SensorConfig config;
  config.can = "unix:/nonexistent/can";
  const auto opened = (*make_sample_source(config))->open();
  ASSERT_FALSE(opened);
  EXPECT_EQ(opened.error().message,
            "unix:/nonexistent/can: cannot connect: No such file or directory: is the node "
            "running?");
}

class LogFile : public ::testing::Test {
 protected:
  LogFile() {
    std::string name = (std::filesystem::temp_directory_path() / "plumbline-XXXXXX").string();
    folder = mkdtemp(name.data());
  }
  ~LogFile() override { std::filesystem::remove_all(folder); }
  Result<std::unique_ptr<SampleSource>> source(const std::string& text) const {
    std::ofstream(folder + "/run.log") << text;
    SensorConfig config;
    config.can = "log:" + folder + "/run.log";
    return make_sample_source(config);
  }
  std::string folder;
};

TEST_F(LogFile, LiteralLinesBecomeASampleAndTheEndIsTold) {
  // counter 0005h; x = 1, y = -1, z = 2; 25.00 °C; stamps that run backwards do not matter
  char crc[3];
  std::snprintf(crc, sizeof crc, "%02X", sample_frames(5, 1, -1, 2, 2500).b.data[7]);
  const auto made = source(
      "(1436509052.249713) can0 1A0#0500010000FFFFFF\n"
      "(1436509052.249913) can0 7FF#00\n"
      "(1436509051.000000) can0 1A1#05C40902000000" +
      std::string(crc) + "\n");
  ASSERT_TRUE((*made)->open());
  const auto batch = (*made)->read(milliseconds(0));
  ASSERT_TRUE(batch);
  EXPECT_TRUE(batch->ended);
  ASSERT_EQ(batch->samples.size(), 1u);
  EXPECT_EQ(batch->samples[0].code, (PerAxis<std::int32_t>{1, -1, 2}));
  EXPECT_DOUBLE_EQ(batch->samples[0].temp_C, 25.0);
  EXPECT_EQ((*made)->statistics().frames, 3u);
}

TEST_F(LogFile, DamageIsNamedByLine) {
  const auto made = source("(1.0) can0 1A0#0500010000FFFFFF\n(1.0) can0 1A1#0\n");
  ASSERT_TRUE((*made)->open());
  const auto batch = (*made)->read(milliseconds(0));
  ASSERT_FALSE(batch);
  EXPECT_EQ(batch.error().message, "log:" + folder + "/run.log:2: half a data byte");
}

TEST_F(LogFile, AcquisitionWaitsForTheReaderOfALog) {
  std::string text;
  for (int counter = 0; counter < 9000; ++counter) {
    const auto frames = sample_frames(counter, counter, 2, 3);
    for (const CanFrame& frame : {frames.a, frames.b}) {
      text += frame.id == 416 ? "(1.0) can0 1A0#" : "(1.0) can0 1A1#";
      for (const std::uint8_t byte : frame.bytes()) {
        char digits[3];
        std::snprintf(digits, sizeof digits, "%02X", byte);
        text += digits;
      }
      text += '\n';
    }
  }
  Acquisition acquisition(*source(text), 100);
  ASSERT_TRUE(acquisition.start());
  std::size_t got = 0;
  for (bool ended = false; !ended;) {
    const auto batch = acquisition.take(milliseconds(1000));
    ASSERT_TRUE(batch);
    got += batch->samples.size();
    ended = batch->ended;
  }
  EXPECT_EQ(got, 9000u);
  EXPECT_EQ(acquisition.statistics().queue_drops, 0u);
}

}  // namespace
}  // namespace plumbline::rig

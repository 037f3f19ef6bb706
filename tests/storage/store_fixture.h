// What the tests of the run store share: a folder of their own and a run to fill.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

#include "storage/run_store.h"

namespace plumbline::storage {

class StoreTest : public testing::Test {
 protected:
  StoreTest() {
    std::string pattern =
        (std::filesystem::temp_directory_path() / "plumbline-test-XXXXXX").string();
    if (::mkdtemp(pattern.data()) == nullptr) throw std::runtime_error("no temporary folder");
    folder_ = pattern;
    file_ = folder_ / "runs.db";
  }
  ~StoreTest() override {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }

  std::filesystem::path folder_;
  std::filesystem::path file_;
};

inline RunHeader example_header() {
  return {.serial = "A-0017",
          .program_version = "0.1.0",
          .config_toml = "[dut]\nserial = \"A-0017\"\n",
          .plan_csv = "ordinal,kind\n0,grid\n",
          .started_utc = "2026-01-02T03:04:05Z",
          .rate_hz = 100,
          .adc = {.bits = 12, .min_V = -5, .max_V = 0}};
}

/// Pose `ordinal` with `count` samples whose content follows from ordinal and index alone.
inline PoseRecord example_pose(long long ordinal, int count = 3, PoseKind kind = PoseKind::grid) {
  PoseRecord pose;
  pose.ordinal = ordinal;
  pose.kind = kind;
  pose.delta_deg = 10.0 * static_cast<double>(ordinal);
  pose.h_deg = 20;
  pose.delta_enc_deg = pose.delta_deg + 0.001;
  pose.h_enc_deg = 19.999;
  pose.settle_s = 0.25;
  for (int i = 0; i < count; ++i) {
    RawSample sample;
    sample.counter = ordinal * 1000 + i;
    sample.t_s = static_cast<double>(ordinal) * 10 + i * 0.01;
    sample.code = {i, -i, static_cast<std::int32_t>(ordinal)};
    sample.temp_C = 20.5;
    sample.status = static_cast<std::uint8_t>(i);
    pose.samples.push_back(sample);
  }
  return pose;
}

}  // namespace plumbline::storage

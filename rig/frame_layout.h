// Binds the signals of a DBC file to their roles in a sample: pure, bytes to values.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "estimator/measurement.h"
#include "rig/carrier.h"
#include "rig/dbc.h"

namespace plumbline::rig {

/// A bus signal that is recorded as a covariate column.
struct CovariateSignal {
  std::string column;  ///< e.g. "rh_pct"
  std::string signal;  ///< "MESSAGE.Signal" of the DBC file
};

/// Which signal plays which part, each as "MESSAGE.Signal". A sample comes as two messages, the one
/// with `counter_a` and the one with `counter_b` (or as one message, when they are the same).
struct SignalRoles {
  std::string counter_a = "ACC_A.Ctr";  ///< low byte of the sample counter in the first message
  std::string counter_b = "ACC_B.Ctr";  ///< the same in the second: what pairs them
  std::string counter_high = "ACC_B.CtrHi";
  std::string x = "ACC_A.X";
  std::string y = "ACC_A.Y";
  std::string z = "ACC_B.Z";
  std::string status = "ACC_A.Status";  ///< empty: the node has none
  std::string temp = "ACC_B.Temp";      ///< empty: the node has none
  std::string crc = "ACC_B.Crc8";       ///< empty: the node has none
};

/// CRC-8, polynomial x⁸+x⁴+x³+x²+1 (1Dh), most significant bit first, no final inversion; `crc`
/// continues an earlier call.
std::uint8_t crc8(std::span<const std::uint8_t> bytes, std::uint8_t crc = 0);

/// The two messages of one sample; `second` is empty when one message carries it all.
struct SampleBytes {
  std::span<const std::uint8_t> first;
  std::span<const std::uint8_t> second;
};

/// A decoded sample, its counter not yet unwrapped.
struct DecodedSample {
  std::uint16_t counter = 0;
  RawSample sample;  ///< counter and t_s are left at 0
};

class FrameLayout {
 public:
  /// Fails (ErrorCode::input) when a signal is missing in the DBC file or cannot play its part.
  static Result<FrameLayout> bind(const Dbc& dbc, const SignalRoles& roles,
                                  const std::vector<CovariateSignal>& covariates);

  enum class Kind {
    foreign,  ///< nothing of ours
    first,
    second,
    both,     ///< CAN FD: the first message with the second behind it, under the first's identifier
    damaged,  ///< one of ours, but too short
  };
  Kind classify(const CanFrame& frame) const;
  bool one_message() const { return first_.name == second_.name; }
  /// Cuts a frame of kind `both`, or a sample in one message.
  SampleBytes cut(const CanFrame& frame) const;

  std::uint8_t counter_of_first(std::span<const std::uint8_t> bytes) const;
  std::uint8_t counter_of_second(std::span<const std::uint8_t> bytes) const;
  /// Nothing when the CRC is wrong.
  std::optional<DecodedSample> decode(const SampleBytes& bytes) const;

  struct CovariateValue {
    const std::string* column;
    double value;
  };
  /// Covariates that this frame carries.
  std::vector<CovariateValue> covariates(const CanFrame& frame) const;

 private:
  struct Bound {
    bool in_second = false;
    DbcSignal signal;
  };
  struct BoundCovariate {
    std::string column;
    std::uint32_t id;
    bool extended;
    DbcSignal signal;
  };
  static std::int64_t raw(const Bound& bound, const SampleBytes& bytes);
  std::uint8_t checksum(const SampleBytes& bytes) const;

  DbcMessage first_;
  DbcMessage second_;
  Bound counter_a_, counter_b_, counter_high_;
  PerAxis<Bound> code_;
  std::optional<Bound> status_, temp_, crc_;
  std::vector<BoundCovariate> covariates_;
};

}  // namespace plumbline::rig

// The vocabulary of the project: what is measured, and how a failure is reported.
//
// Plain structs only. rig/ and storage/ include this header and nothing else of estimator/.
// Units stand in the names; angles are degrees here and become radians once, in the kinematics.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <tl/expected.hpp>
#include <utility>
#include <vector>

namespace plumbline {

/// Standard acceleration of gravity g_n, m/s² (CGPM 1901); one "g" of the model.
inline constexpr double kStandardGravity_mps2 = 9.80665;

inline constexpr std::size_t kAxisCount = 3;
inline constexpr std::array<const char*, kAxisCount> kAxisName = {"x", "y", "z"};

/// One value for each sensor axis, in the order x, y, z.
template <class T>
using PerAxis = std::array<T, kAxisCount>;

// --- failures ------------------------------------------------------------------------------------

/// What kind of operational failure; decides the exit code of the program.
enum class ErrorCode {
  input,     ///< arguments, configuration or input file are wrong (exit code 2)
  output,    ///< the output folder or file cannot be written (exit code 2)
  rig,       ///< drive, sensor bus or node failed (exit code 3)
  storage,   ///< the run database failed while a rig was running (exit code 3)
  internal,  ///< a defect of this program (exit code 4)
};

/// An operational failure: one line that says where, what and why.
struct Error {
  ErrorCode code = ErrorCode::internal;
  std::string message;
};

/// A value or an Error. Ignoring one is a compiler warning.
template <class T>
class [[nodiscard]] Result : public tl::expected<T, Error> {
 public:
  using tl::expected<T, Error>::expected;
};

/// `return fail(ErrorCode::input, "samples.csv:12: …");`
inline tl::unexpected<Error> fail(ErrorCode code, std::string message) {
  return tl::unexpected<Error>(Error{code, std::move(message)});
}
inline tl::unexpected<Error> fail(Error error) { return tl::unexpected<Error>(std::move(error)); }

// --- measured data -------------------------------------------------------------------------------

/// A further quantity recorded beside the outputs (supply voltage, humidity …), one value a sample.
struct Covariate {
  std::string name;           ///< column name, unit included (`rh_pct`)
  std::vector<double> value;  ///< one per sample
};

/// Samples column by column; all columns have size() entries, optional ones may be empty.
struct SampleTable {
  std::vector<double> t_s;            ///< since the start of the run, strictly increasing
  PerAxis<std::vector<double>> u_V;   ///< output voltages
  std::vector<double> temp_C;         ///< at the sensor; empty when not recorded
  std::vector<double> delta_enc_deg;  ///< encoder reading; empty when not recorded
  std::vector<double> h_enc_deg;      ///< encoder reading; empty when not recorded
  std::vector<Covariate> covariates;

  std::size_t size() const { return t_s.size(); }
};

/// One visit of a position. Its samples are rows [first, first + count) of the table.
struct Pose {
  long long number = 0;   ///< counts the visits; a position visited twice has two numbers
  double delta_deg = 0;   ///< commanded spindle angle δ
  double h_deg = 0;       ///< commanded tilt h
  std::size_t first = 0;  ///< row of the first sample (the arrival)
  std::size_t count = 0;
};

/// Samples of a run, cut into poses. Without angles (a scalar set) `has_angles` is false.
struct MeasurementSet {
  SampleTable samples;
  std::vector<Pose> poses;
  bool has_angles = true;
  std::size_t skipped_rows = 0;  ///< rows refused and skipped on request
};

/// One sample as it came over the bus, before any conversion.
struct RawSample {
  std::int64_t counter = 0;  ///< the node's sample counter, unwrapped; orders samples, shows losses
  double t_s = 0;            ///< node sample clock, seconds since the start of the run
  PerAxis<std::int32_t> code{};  ///< sign-extended ADC codes
  double temp_C = 0;
  std::uint8_t status = 0;  ///< status byte of the node, as received
};

// --- description of a run (run.toml) -------------------------------------------------------------

struct DeviceUnderTest {
  std::string serial;
  std::string model;
};

struct Gravity {
  double local_mps2 = kStandardGravity_mps2;  ///< g at the rig
  double u_mps2 = 0;                          ///< its standard uncertainty
};

/// Analogue-to-digital converter: code c in [−2^(bits−1), 2^(bits−1)) stands for mid + c·lsb.
struct Adc {
  int bits = 16;
  double min_V = -5.0;
  double max_V = 0.0;

  double lsb_V() const { return (max_V - min_V) / static_cast<double>(std::int64_t{1} << bits); }
  double volts(std::int32_t code) const { return 0.5 * (min_V + max_V) + code * lsb_V(); }
};

struct AngleRange {
  double start_deg = 0;
  double stop_deg = 0;
  double step_deg = 10;
};

struct Grid {
  AngleRange delta{0, 350, 10};
  AngleRange h{0, 80, 10};
};

/// Standard uncertainty of one positioning.
struct AngleUncertainty {
  double delta_arcsec = 0;
  double h_arcsec = 0;
};

/// Acceptance limit, input-referred.
struct Limits {
  double max_abs_error_mps2 = 0;
};

/// Everything that `run.toml` says.
struct RunDescription {
  DeviceUnderTest dut;
  Gravity gravity;
  std::optional<Adc> adc;  ///< absent: nothing is assumed about quantization
  double reference_C = 20.0;
  Grid grid;
  AngleUncertainty angles;
  std::optional<Limits> limits;
  /// The head goes from one δ to the next as commanded, never the shorter way past 360°. Files do
  /// not say so.
  bool goes_as_commanded = false;
};

}  // namespace plumbline

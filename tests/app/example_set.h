// A small measurement set with known parameters, in the file formats of the program.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <string>

namespace plumbline::app {

struct ExampleSet {
  /// Rows x, y, z; columns K_ix, K_iy, K_iz (V/g) and U_i0 (V).
  Eigen::Matrix<double, 3, 4> parameters =
      (Eigen::Matrix<double, 3, 4>() << 0.032, -0.0017, 0.0001, -2.5865, 0.0022, 0.0314, 0.0002,
       -2.4363, -0.0003, -0.0017, -0.0328, -2.3423)
          .finished();
  double noise_V = 3e-4;          ///< white, per sample
  double quadratic_g_per_g2 = 0;  ///< k2 of axis x: an effect the model lacks
  int delta_step_deg = 30;
  int h_step_deg = 20;
  int samples_per_pose = 20;
  int static_samples = 3000;
  std::uint64_t seed = 1;

  /// Outputs without noise.
  Eigen::Vector3d outputs_V(double delta_deg, double h_deg) const;
  /// Writes samples.csv, static.csv and run.toml.
  void write(const std::filesystem::path& folder) const;
};

/// The run.toml that belongs to it.
std::string example_run_toml();

/// A result.json less what differs from run to run.
std::string without_provenance(const std::filesystem::path& file);

}  // namespace plumbline::app

#include "tests/app/example_set.h"

#include <fmt/format.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>

#include "tests/app/temp_folder.h"

namespace plumbline::app {

namespace {

constexpr double kLocalGravity_mps2 = 9.8101;

Eigen::Vector4d specific_force(double delta_deg, double h_deg) {
  const double delta = delta_deg * std::numbers::pi / 180;
  const double h = h_deg * std::numbers::pi / 180;
  const double gamma = kLocalGravity_mps2 / 9.80665;
  return {gamma * std::cos(h) * std::cos(delta), -gamma * std::cos(h) * std::sin(delta),
          gamma * std::sin(h), 1.0};
}

}  // namespace

std::string example_run_toml() {
  return "[dut]\nserial = \"T-1\"\nmodel = \"triad\"\n"
         "[gravity]\nlocal_mps2 = 9.8101\nu_mps2 = 0.00002\n"
         "[angles]\nu_delta_arcsec = 1.0\nu_h_arcsec = 1.0\n";
}

Eigen::Vector3d ExampleSet::outputs_V(double delta_deg, double h_deg) const {
  const Eigen::Vector4d a = specific_force(delta_deg, h_deg);
  Eigen::Vector3d u = parameters * a;
  u[0] += parameters(0, 0) * quadratic_g_per_g2 * a[0] * a[0];
  return u;
}

void ExampleSet::write(const std::filesystem::path& folder) const {
  std::mt19937_64 engine(seed);
  std::normal_distribution<double> noise(0.0, noise_V);
  const auto outputs = [&](double delta_deg, double h_deg) -> std::string {
    Eigen::Vector3d u = outputs_V(delta_deg, h_deg);
    for (double& value : u) value += noise(engine);
    return fmt::format("{:.8f},{:.8f},{:.8f}", u[0], u[1], u[2]);
  };

  std::ofstream samples(folder / "samples.csv");
  samples << "t_s,pose,delta_deg,h_deg,ux_V,uy_V,uz_V\n";
  double t_s = 0;
  int pose = 0;
  for (int h = 0; h <= 80; h += h_step_deg) {
    for (int delta = 0; delta < 360; delta += delta_step_deg, ++pose) {
      t_s += 2.0;
      for (int i = 0; i < samples_per_pose; ++i, t_s += 0.01) {
        samples << fmt::format("{:.4f},{},{},{},{}\n", t_s, pose, delta, h, outputs(delta, h));
      }
    }
  }
  std::ofstream record(folder / "static.csv");
  record << "t_s,ux_V,uy_V,uz_V\n";
  for (int i = 0; i < static_samples; ++i) {
    record << fmt::format("{:.4f},{}\n", 0.01 * i, outputs(0, 0));
  }
  std::ofstream(folder / "run.toml") << example_run_toml();
}

std::string without_provenance(const std::filesystem::path& file) {
  auto json = nlohmann::ordered_json::parse(text_of(file));
  json.erase("provenance");
  return json.dump();
}

}  // namespace plumbline::app

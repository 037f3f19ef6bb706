#include "app/io/csv_writer.h"

#include <fmt/format.h>

#include <iterator>
#include <string>

#include "app/io/files.h"

namespace plumbline::app {

namespace {

/// A name that would not survive the way through a file.
const Covariate* unwritable(const SampleTable& samples) {
  for (const Covariate& covariate : samples.covariates) {
    if (covariate.name.empty() || covariate.name.find_first_of(",\"\r\n") != std::string::npos) {
      return &covariate;
    }
  }
  return nullptr;
}

void append_optional_names(std::string& text, const SampleTable& samples) {
  if (!samples.delta_enc_deg.empty()) text += ",delta_enc_deg";
  if (!samples.h_enc_deg.empty()) text += ",h_enc_deg";
  if (!samples.temp_C.empty()) text += ",temp_C";
  for (const Covariate& covariate : samples.covariates) text += "," + covariate.name;
  text += '\n';
}

void append_row(std::string& text, const SampleTable& samples, std::size_t row) {
  auto out = std::back_inserter(text);
  for (const auto& axis : samples.u_V) fmt::format_to(out, ",{}", axis[row]);
  if (!samples.delta_enc_deg.empty()) fmt::format_to(out, ",{}", samples.delta_enc_deg[row]);
  if (!samples.h_enc_deg.empty()) fmt::format_to(out, ",{}", samples.h_enc_deg[row]);
  if (!samples.temp_C.empty()) fmt::format_to(out, ",{}", samples.temp_C[row]);
  for (const Covariate& covariate : samples.covariates) {
    fmt::format_to(out, ",{}", covariate.value[row]);
  }
  text += '\n';
}

Result<void> refuse_name(const std::filesystem::path& path, const Covariate& covariate) {
  return fail(ErrorCode::output,
              fmt::format("{}: a column cannot be called '{}'", path.string(), covariate.name));
}

}  // namespace

Result<void> write_samples(const std::filesystem::path& path, const MeasurementSet& set) {
  if (const Covariate* covariate = unwritable(set.samples)) return refuse_name(path, *covariate);
  std::string text =
      set.has_angles ? "t_s,pose,delta_deg,h_deg,ux_V,uy_V,uz_V" : "t_s,pose,ux_V,uy_V,uz_V";
  append_optional_names(text, set.samples);
  for (const Pose& pose : set.poses) {
    std::string place = fmt::format(",{}", pose.number);
    if (set.has_angles) place += fmt::format(",{},{}", pose.delta_deg, pose.h_deg);
    for (std::size_t row = pose.first; row < pose.first + pose.count; ++row) {
      fmt::format_to(std::back_inserter(text), "{}{}", set.samples.t_s[row], place);
      append_row(text, set.samples, row);
    }
  }
  return write_file_atomically(path, text);
}

Result<void> write_static(const std::filesystem::path& path, const SampleTable& samples) {
  if (const Covariate* covariate = unwritable(samples)) return refuse_name(path, *covariate);
  std::string text = "t_s,ux_V,uy_V,uz_V";
  append_optional_names(text, samples);
  for (std::size_t row = 0; row < samples.size(); ++row) {
    fmt::format_to(std::back_inserter(text), "{}", samples.t_s[row]);
    append_row(text, samples, row);
  }
  return write_file_atomically(path, text);
}

}  // namespace plumbline::app

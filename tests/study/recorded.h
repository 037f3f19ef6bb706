// Pages on recorded data of real sensors: what the residual is, what drives it, and the error
// before and after on data that were neither fitted nor looked at. The data lie elsewhere.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "estimator/measurement.h"

namespace plumbline::study {

inline constexpr double kMilli = 1e3;  ///< mm/s² in m/s²

/// A triad turned through rests without known angles.
struct RestRecord {
  std::string title;
  std::string source;  ///< what was recorded, in a sentence
  MeasurementSet set;  ///< poses are the rests
  double local_mps2 = kStandardGravity_mps2;
};

/// A record at rest, m/s², and another of the same sensor that is left out.
struct StillRecords {
  std::string title;
  std::string source;
  double rate_hz = 0;
  PerAxis<std::vector<double>> fitted_mps2;
  PerAxis<std::vector<double>> left_out_mps2;
};

/// An HTML page each. Errors: those of the calibration.
Result<std::string> rest_page(const RestRecord& record);
std::string still_page(const StillRecords& records);

/// mm/s² of m/s².
std::string mm(double value_mps2);
/// Frame of a page and a table; the first row is the head.
std::string html_page(const std::string& title, const std::string& body);
std::string html_table(const std::vector<std::vector<std::string>>& rows);

}  // namespace plumbline::study

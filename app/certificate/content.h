// The chapters of a certificate; each appends its blocks. Used by make_certificate() only.
#pragma once

#include <memory>

#include "app/certificate/certificate.h"

namespace plumbline::app::content {

inline constexpr double kCoverageFactor = 2;

struct Composer {
  Document& document;
  const CertificateInput& input;
  const Translator& tr;
  std::shared_ptr<const Calibration> calibration;  ///< what figures keep

  /// Figures are numbered: on paper one may stand where there is room.
  void add(Block block) const;
  std::size_t figures() const;  ///< so far
};

void add_identification(const Composer& composer);
void add_method(const Composer& composer);
void add_parameters(const Composer& composer);
void add_budget(const Composer& composer);
void add_estimators(const Composer& composer);
void add_errors(const Composer& composer);
void add_findings(const Composer& composer);
void add_noise(const Composer& composer);
void add_decision(const Composer& composer);
void add_history(const Composer& composer);

// A calibration without angles (composer.input.scalar) says these in their place.
std::string scalar_error_sentence(const Composer& composer);
std::string scalar_method(const Composer& composer);
void add_scalar_results(const Composer& composer);
void add_scalar_errors(const Composer& composer);
void add_scalar_budget(const Composer& composer);

/// The empty table of an uncertainty budget; `contribution` heads the column of c·u.
Table budget_table(const Composer& composer, std::string caption, std::string contribution);
/// mm/s² of m/s², three digits.
std::string milli_mps2(double value_mps2);
/// Capital letter, full stop; an effect's id at the beginning stays as it is written.
std::string sentence(std::string text);

}  // namespace plumbline::app::content

// The calibration certificate: what it says (ISO/IEC 17025:2017, 7.8.2 and 7.8.4) and its pages.
#pragma once

#include <string>
#include <vector>

#include "app/certificate/document.h"
#include "app/certificate/language.h"
#include "app/config/laboratory.h"
#include "app/provenance.h"
#include "estimator/calibrate.h"

namespace plumbline::app {

/// Something that happened during the run and belongs on the certificate.
struct CertificateEvent {
  double t_s = 0;
  std::string kind;
  std::string text;
};

struct SigningKey;
struct ScalarResults;

struct CertificateInput {
  const RunDescription& description;
  const Calibration& calibration;
  const Provenance& provenance;
  const Evaluation* verification = nullptr;  ///< fresh poses of the same run, when there were any
  std::vector<CertificateEvent> events;
  Laboratory laboratory = {};
  Language language = Language::en;
  std::string result_sha256 = {};  ///< of result.json; empty: not printed
  std::string started_utc = {};    ///< of a stored run; empty: not known
  std::string finished_utc = {};
  const SigningKey* signing = nullptr;  ///< signs the XML; none: it is not signed
  /// A calibration without angles; `calibration` is then shared_chapters() of it.
  const ScalarResults* scalar = nullptr;
};

/// "PL-A-0017-20260131-1a2b3c4d": serial, date, and the first digits of the hash over the inputs.
std::string certificate_id(const Provenance& provenance);

/// First and last day of the measurement, as far as known: what lab.toml says, else what the stored
/// run says, else empty.
struct PerformanceDates {
  std::string from;
  std::string to;
};
PerformanceDates performance_dates(const CertificateInput& input);

/// Kind of the event that says that the run did not finish.
inline constexpr const char* kIncomplete = "incomplete";
bool is_unfinished(const std::vector<CertificateEvent>& events);

/// What may be stated of a decision: the poses that a run never reached may hold the largest error,
/// so that one that did not finish can fail, but not pass. Without a status the numbers stay.
Decision stated_decision(Decision decision, const std::vector<CertificateEvent>& events);

/// The document in reading order. `input.calibration` must have full rank unless it is scalar. `tr`
/// decides the language; input.language is what callers make it from.
Document make_certificate(const CertificateInput& input, const Translator& tr);
Document make_certificate(const CertificateInput& input);

/// One self-contained page: style and pictures inside, no scripts, prints on A4 with the
/// certificate's number and "page n of m" on every sheet.
std::string write_html(const Document& document);

}  // namespace plumbline::app

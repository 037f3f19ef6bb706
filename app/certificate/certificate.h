// The calibration certificate: what it says (ISO/IEC 17025:2017, 7.8.2 and 7.8.4) and its pages.
#pragma once

#include <string>
#include <vector>

#include "app/certificate/document.h"
#include "app/provenance.h"
#include "estimator/calibrate.h"

namespace plumbline::app {

/// Something that happened during the run and belongs on the certificate.
struct CertificateEvent {
  double t_s = 0;
  std::string kind;
  std::string text;
};

struct CertificateInput {
  const RunDescription& description;
  const Calibration& calibration;
  const Provenance& provenance;
  const Evaluation* verification = nullptr;  ///< fresh poses of the same run, when there were any
  std::vector<CertificateEvent> events;
};

/// "PL-A-0017-20260131-1a2b3c4d": serial, date, and the first digits of the hash over the inputs.
std::string certificate_id(const Provenance& provenance);

/// The document in reading order. `input.calibration` must have full rank.
Document make_certificate(const CertificateInput& input);

/// One self-contained page: style and pictures inside, no scripts, prints on A4 with the
/// certificate's number and "page n of m" on every sheet.
std::string write_html(const Document& document);

}  // namespace plumbline::app

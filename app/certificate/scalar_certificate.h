// The certificate of a calibration without angles, in the same document model.
#pragma once

#include "app/certificate/certificate.h"
#include "app/scalar_job.h"

namespace plumbline::app {

struct ScalarCertificateInput {
  const RunDescription& description;
  const ScalarCalibration& calibration;
  const ScalarSource& source;
  const Provenance& provenance;
};

Document make_scalar_certificate(const ScalarCertificateInput& input);

}  // namespace plumbline::app

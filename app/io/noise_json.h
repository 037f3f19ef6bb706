// noise.json (schema "plumbline.noise/1", app/io/schema/noise.schema.json).
#pragma once

#include <string>
#include <vector>

#include "app/io/json.h"
#include "app/provenance.h"
#include "estimator/noise/allan.h"
#include "estimator/noise/noise_model.h"

namespace plumbline::app {

/// One identified channel.
struct NoiseChannel {
  std::string axis;    ///< "x", "y" or "z"
  std::string column;  ///< of the file
  std::string unit;    ///< of the record after scaling
  NoiseModel noise;
  DeviationSet deviations;  ///< empty curves when the record cannot tell
};

struct NoiseReport {
  double rate_hz = 0;
  std::size_t samples = 0;
  std::vector<NoiseChannel> channels;
};

/// "line", "line that wanders" or "harmonic 3 of 0.5642 Hz".
std::string line_name(const SpectralLine& line);

Json noise_json(const NoiseReport& report, const Provenance& provenance);

}  // namespace plumbline::app

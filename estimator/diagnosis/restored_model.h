// The way back from what was reported to the model that it stands for.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "estimator/calibrate.h"
#include "estimator/diagnosis/enlarged_model.h"

namespace plumbline {

/// The enlarged model that reported effects stand for, on a set with its own log.
struct RestoredModel {
  EnlargedParameters parameters;
  std::vector<std::shared_ptr<const Effect>> owned;  ///< effects that exist for that set only
  /// Names of what belonged to one run, needs a column that the set lacks, or is not known here.
  std::vector<std::string> left_out;
  std::vector<std::string> lacking;  ///< columns that effects among them need
};
/// What happened to single poses of a run is part of the model on that run alone.
enum class RestoredFor { any_set, its_run };
RestoredModel restore_model(const CertifiedModel& model, const VisitLog& log,
                            RestoredFor use = RestoredFor::any_set);

}  // namespace plumbline

// Search beside bits of a converter that are stuck: where noise hardly smooths the edges of such a
// bit, it is given back to every reading first.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "estimator/calibrate.h"
#include "estimator/diagnosis/code_estimate.h"
#include "estimator/diagnosis/search.h"

namespace plumbline {

/// Gives the bits of an axis that are stuck, from the lowest on, their value back: u_V in V, which
/// is changed. What a dwell measures is its likeliest voltage about where it is expected
/// (`expected_V`, one for each of `poses`, usually off by `off_V`, less than half the lowest bit's
/// weight); every reading is the one next to it that the converter can have made into what was
/// read. Where noise of a reading (`sd_V`) reaches over the bit, all readings of a dwell are moved
/// until their mean is that voltage. Returns the variance of each mean beyond that of the noise,
/// V²: that of not knowing which reading is which.
Eigen::VectorXd give_bits_back(const std::vector<StuckBit>& stuck, const Adc& adc, double sd_V,
                               const Eigen::VectorXd& expected_V, double off_V,
                               const std::vector<Pose>& poses, std::vector<double>& u_V);

/// A search of readings without their stuck bits, and what it means for the readings as they are.
struct SearchBesideBits {
  std::unique_ptr<const VisitLog> log;  ///< with the bits given back; the candidates are from it
  CandidateList candidates;             ///< of `found`
  SearchResult found;                   ///< the model with the bits, of the readings as measured
  CodeEstimate given_back;  ///< the model without them, of the readings with the bits given back
};

/// Such a model is linear in what is looked for: a bit that is part of the model instead turns
/// every error of the model on its edges into one of the bit's weight, in which what else there is
/// on that axis hides. Searches anew as long as what was found moves readings to the other side of
/// an edge. Nothing where no bit is stuck or noise smooths its edges, and where noise reaches over
/// the bit and something changes within the dwells; `own`: CalibrationOptions'.
std::optional<SearchBesideBits> search_beside_stuck_bits(
    const SearchInput& input, const CalibrationInput& measured, const Eigen::MatrixXd& A,
    const std::vector<std::shared_ptr<const Effect>>& own, const SearchOptions& options);

/// Follows where effects were dropped from the model without the bits, given by their places one
/// after the other.
void drop_effects(const SearchInput& input, const std::vector<std::size_t>& dropped,
                  SearchResult& found, CodeEstimate& given_back);

}  // namespace plumbline

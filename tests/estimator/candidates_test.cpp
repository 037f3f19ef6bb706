// What a search works out once for all of its steps is what each model would make of it.
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "estimator/diagnosis/candidate_gains.h"
#include "estimator/diagnosis/enlarged_model.h"
#include "estimator/linear_algebra.h"
#include "tests/estimator/example_visits.h"

namespace plumbline {
namespace {

struct Candidates : testing::Test {
  VisitLog log = example_log();
  CandidateList list = all_candidates(log);
};

TEST_F(Candidates, AxesShareOnlyWhatIsTheSameOnEach) {
  std::size_t shared = 0;
  for (const Candidate& candidate : list.candidates) {
    const std::vector<SingleAmplitude> own = single_amplitudes(log, candidate.active());
    shared += candidate.singles.use_count() > 1 ? 1 : 0;
    ASSERT_EQ(own.size(), candidate.singles->size()) << candidate.effect->id();
    for (std::size_t k = 0; k < own.size(); ++k) {
      ASSERT_EQ(own[k].p, (*candidate.singles)[k].p) << candidate.effect->id();
      ASSERT_EQ(own[k].number, (*candidate.singles)[k].number)
          << candidate.effect->id() << " on " << kAxisName[candidate.axis];
    }
  }
  EXPECT_GT(shared, list.candidates.size() / 4);
}

TEST_F(Candidates, TheirResponsesAreTheChangeThatEachMakes) {
  EnlargedParameters model = twelve();
  model.effects.push_back(list.candidates[list.candidates.size() / 2].active());
  const CandidateResponses responses = candidate_responses_V(log, list, model);
  const auto n = std::ssize(log.visits);
  const Eigen::VectorXd before_V = predict_stacked_V(log, model);
  // Of a head effect to first order, and not what it changes in the terms of others.
  constexpr double kOfSecondOrder = 2e-3;
  for (std::size_t c = 0; c < list.candidates.size(); ++c) {
    const Candidate& candidate = list.candidates[c];
    const auto& [g, first, count] = responses.place[c];
    const CandidateResponses::Group& group = responses.groups[g];
    for (Eigen::Index j = 0; j < count; ++j) {
      ActiveEffect single = candidate.active();
      single.p = (*candidate.singles)[static_cast<std::size_t>(j)].p;
      const Eigen::VectorXd change_V =
          predict_stacked_V(log, with_effect(model, single)) - before_V;
      Eigen::VectorXd response_V = Eigen::VectorXd::Zero(change_V.size());
      response_V.segment(group.first_row, group.means.rows()) = group.means.col(first + j);
      response_V.segment(group.first_dwell_row, group.dwells.rows()) = group.dwells.col(first + j);
      const bool of_head = candidate.effect->subject() == Subject::head;
      EXPECT_LT((response_V - change_V).norm(),
                (of_head ? kOfSecondOrder : 1e-9) * change_V.norm() +
                    1e-12 * std::sqrt(static_cast<double>(n)))
          << candidate.effect->id() << " " << candidate.hypothesis.p.size();
    }
  }
}

TEST_F(Candidates, GainIsWhatAColumnTakesOfTheResidualBesideTheModel) {
  PoseWhitening whitening;
  const auto n = std::ssize(log.visits);
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    whitening.set(axis, 1e-10 * (Eigen::MatrixXd::Identity(n, n) + Eigen::MatrixXd::Ones(n, n)));
    whitening.dwell_sd_V[axis] = Eigen::VectorXd::Constant(log.dwell_contrasts(), 1e-5);
  }
  Observations observed;
  observed.mean_V = predict_means_V(log, twelve());
  observed.dwell_V = predict_dwells_V(log, twelve());
  for (auto& mean_V : observed.mean_V)
    for (Eigen::Index k = 0; k < n; ++k)
      mean_V(k) += 1e-5 * std::sin(1.7 * static_cast<double>(k * k));
  const EnlargedFit fit = fit_enlarged(log, observed, whitening, twelve());
  const CandidateResponses responses = candidate_responses(log, list, whitening, fit.parameters);
  const CandidateGains gains(responses, fit);
  const Eigen::VectorXd& of_residual = gains.of_residual();
  for (std::size_t c = 0; c < list.candidates.size(); c += 17) {
    const auto& [g, first, count] = responses.place[c];
    const CandidateResponses::Group& group = responses.groups[g];
    if (gains.dof(c) < count) continue;
    const Eigen::Index twelve_columns = fit.whitened_jacobian.cols();
    Eigen::MatrixXd columns =
        Eigen::MatrixXd::Zero(fit.whitened_jacobian.rows(), twelve_columns + count);
    columns.leftCols(twelve_columns) = fit.whitened_jacobian;
    columns.block(group.first_row, twelve_columns, group.means.rows(), count) =
        group.means.middleCols(first, count);
    columns.block(group.first_dwell_row, twelve_columns, group.dwells.rows(), count) =
        group.dwells.middleCols(first, count);
    const auto taken = [&](const Eigen::MatrixXd& span) {
      return (orthonormal_basis(span).transpose() * fit.whitened_residual).squaredNorm();
    };
    const double gain = taken(columns) - taken(fit.whitened_jacobian);
    EXPECT_NEAR(of_residual(static_cast<Eigen::Index>(c)), gain, 1e-6 * (1 + gain))
        << list.candidates[c].effect->id();
  }
}

}  // namespace
}  // namespace plumbline

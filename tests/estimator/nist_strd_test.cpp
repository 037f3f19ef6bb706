// NIST Statistical Reference Datasets: certified values of linear regressions, scored by digits
// (log relative error) of the worst coefficient.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "estimator/fit/least_squares.h"

namespace plumbline {
namespace {

enum class Model { straight_line, quadratic, through_origin, multiple, polynomial };

struct Case {
  const char* name;
  Model model;
  Eigen::Index parameters;
  double digits;
};

std::ostream& operator<<(std::ostream& out, const Case& c) { return out << c.name; }

struct Dataset {
  std::vector<double> certified;
  std::vector<double> certified_u;
  double residual_sd = 0;
  Eigen::MatrixXd rows;  ///< y first
};

double number(std::string text) {
  std::replace(text.begin(), text.end(), 'D', 'E');
  return std::stod(text);
}

Dataset read(const std::filesystem::path& path) {
  Dataset data;
  std::ifstream file(path);
  std::vector<std::vector<double>> rows;
  std::string line;
  for (int number_of_line = 1; std::getline(file, line); ++number_of_line) {
    std::istringstream words(line);
    std::string word;
    words >> word;
    // Certified parameters: "B0  estimate  sd" above the data, which begin at line 61.
    if (number_of_line < 61) {
      std::string value;
      std::string u;
      if (number_of_line > 28 && word.size() >= 2 && word[0] == 'B' && std::isdigit(word[1]) &&
          words >> value >> u) {
        data.certified.push_back(number(value));
        data.certified_u.push_back(number(u));
      }
      std::string second;
      if (word == "Standard" && words >> second >> value && second == "Deviation")
        data.residual_sd = number(value);
      continue;
    }
    std::vector<double> values;
    for (bool more = !word.empty(); more; more = static_cast<bool>(words >> word)) {
      try {
        values.push_back(std::stod(word));
      } catch (const std::exception&) {
        break;
      }
    }
    if (values.size() >= 2) rows.push_back(values);
  }
  if (rows.empty()) return data;
  data.rows.resize(std::ssize(rows), std::ssize(rows[0]));
  for (Eigen::Index i = 0; i < data.rows.rows(); ++i)
    for (Eigen::Index j = 0; j < data.rows.cols(); ++j)
      data.rows(i, j) = rows[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)];
  return data;
}

Eigen::MatrixXd design(const Case& c, const Dataset& data) {
  Eigen::MatrixXd A(data.rows.rows(), c.parameters);
  const Eigen::VectorXd x = data.rows.col(1);
  for (Eigen::Index j = 0; j < c.parameters; ++j) {
    if (c.model == Model::through_origin)
      A.col(j) = x;
    else if (c.model == Model::multiple)
      A.col(j) = j == 0 ? Eigen::VectorXd::Ones(A.rows()) : Eigen::VectorXd(data.rows.col(j));
    else
      A.col(j) = x.array().pow(static_cast<double>(j));
  }
  return A;
}

double digits_agreed(double value, double certified) {
  const double error = std::abs(value - certified);
  const double relative = certified == 0 ? error : error / std::abs(certified);
  return relative == 0 ? 15.0 : std::min(15.0, -std::log10(relative));
}

class NistStrd : public testing::TestWithParam<Case> {};

TEST_P(NistStrd, AgreesWithTheCertifiedValues) {
  const Case& c = GetParam();
  const auto path = std::filesystem::path(PLUMBLINE_SHARED_DIR) / "data/nist_strd" /
                    (std::string(c.name) + ".dat");
  if (!std::filesystem::exists(path)) GTEST_SKIP() << path << " is not here";
  const Dataset data = read(path);
  ASSERT_EQ(std::ssize(data.certified), c.parameters);
  ASSERT_GT(data.rows.rows(), c.parameters);

  const LeastSquaresResult fit = solve_least_squares(design(c, data), data.rows.col(0));

  ASSERT_EQ(fit.rank, c.parameters);
  const double s =
      std::sqrt(fit.residual_sum_of_squares / static_cast<double>(fit.degrees_of_freedom));
  double worst = 15;
  double worst_u = 15;
  for (Eigen::Index j = 0; j < c.parameters; ++j) {
    const auto k = static_cast<std::size_t>(j);
    worst = std::min(worst, digits_agreed(fit.x(j), data.certified[k]));
    worst_u =
        std::min(worst_u, digits_agreed(s * std::sqrt(fit.cofactor(j, j)), data.certified_u[k]));
  }
  RecordProperty("digits", std::to_string(worst));
  std::cout << c.name << ": " << worst << " digits, uncertainties " << worst_u << "\n";
  EXPECT_GE(worst, c.digits);
  // Wampler1 and Wampler2 fit exactly: their certified uncertainties are zero.
  if (data.residual_sd > 0) {
    EXPECT_GE(worst_u, std::min(c.digits, 8.0) - 1.0);
    EXPECT_GE(digits_agreed(s, data.residual_sd), std::min(c.digits, 10.0) - 1.0);
  } else {
    EXPECT_LT(s, 1e-6);
  }
}

INSTANTIATE_TEST_SUITE_P(All, NistStrd,
                         testing::Values(Case{"Norris", Model::straight_line, 2, 12},
                                         Case{"Pontius", Model::quadratic, 3, 12},
                                         Case{"NoInt1", Model::through_origin, 1, 14},
                                         Case{"NoInt2", Model::through_origin, 1, 14},
                                         Case{"Longley", Model::multiple, 7, 10.5},
                                         Case{"Filip", Model::polynomial, 11, 7},
                                         Case{"Wampler1", Model::polynomial, 6, 9},
                                         Case{"Wampler2", Model::polynomial, 6, 12},
                                         Case{"Wampler3", Model::polynomial, 6, 9},
                                         Case{"Wampler4", Model::polynomial, 6, 7.5},
                                         Case{"Wampler5", Model::polynomial, 6, 5.5}),
                         [](const auto& parameter) { return std::string(parameter.param.name); });

}  // namespace
}  // namespace plumbline

// χ² and normal distributions and ln Γ, as far as limits and p-values need them.
#pragma once

namespace plumbline {

/// P(χ²_dof > x). dof > 0.
double chi_squared_tail(double x, double dof);

/// P(F > f) of the F distribution with dof1, dof2 > 0 degrees of freedom; χ² in the limit.
double f_tail(double f, double dof1, double dof2);

/// ln Γ(x), x > 0. Not std::lgamma, which writes a global sign and so races between threads.
double log_gamma(double x);

/// x with P(χ²_dof ≤ x) = p, 0 < p < 1, dof > 0 (not necessarily whole).
double chi_squared_quantile(double p, double dof);

/// P(Z < z) of the standard normal distribution.
double normal_below(double z);

/// P(|Z| > z) of the standard normal distribution, z ≥ 0.
double normal_two_sided_tail(double z);

/// z with P(Z ≤ z) = p, 0 < p < 1.
double normal_quantile(double p);

}  // namespace plumbline

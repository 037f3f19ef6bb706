// Power of a record in the cosine basis, in which the noise terms are (nearly) uncorrelated.
#pragma once

#include <complex>
#include <cstddef>
#include <vector>

namespace plumbline {

/// Orthonormal DCT-II of the longest beginning of the record whose length has no prime factor
/// above 5 (under 4 % are left out, under 1 % beyond 10⁴ samples). Coefficient 0, the mean, is
/// included.
///
/// Why cosines: the coefficients of white noise and of a random walk about its mean are exactly
/// uncorrelated, without the leakage that the Fourier transform of a random walk suffers from, and
/// a constant is confined to coefficient 0. Coefficient k sits at frequency k·rate/(2·length).
std::vector<double> cosine_transform(const std::vector<double>& record);

/// Σ x_i·exp(−2πi·k·i/length) for k = 0 … length/2 of the longest beginning of the record whose
/// `length` is a multiple of 4 without a prime factor above 5. Records of at least 4 samples
/// (precondition).
std::vector<std::complex<double>> fourier_transform(const std::vector<double>& record,
                                                    std::size_t& length);

}  // namespace plumbline

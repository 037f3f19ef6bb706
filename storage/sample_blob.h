// Raw samples as bytes and back.
//
// The samples of a pose are stored as one BLOB and not as rows: they are written together, read
// together and never changed, so a BLOB is one insert instead of dozens, takes a third of the room,
// and is already the canonical byte string over which a hash can be taken. What is lost, SQL access
// to single samples, `plumbline export` gives back.
//
// Layout, little-endian, 37 bytes a sample without padding, in order of arrival:
//   offset  0  int64    counter
//           8  float64  t_s         (IEEE 754 binary64)
//          16  int32    code x
//          20  int32    code y
//          24  int32    code z
//          28  float64  temp_C
//          36  uint8    status
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "estimator/measurement.h"

namespace plumbline::storage {

inline constexpr std::size_t kSampleBytes = 37;

std::vector<std::byte> pack_samples(std::span<const RawSample> samples);
/// Precondition: bytes.size() is a multiple of kSampleBytes (the schema sees to it).
std::vector<RawSample> unpack_samples(std::span<const std::byte> bytes);

}  // namespace plumbline::storage

#include "storage/sample_blob.h"

#include <bit>
#include <cassert>
#include <cstdint>
#include <limits>

namespace plumbline::storage {

namespace {

static_assert(std::numeric_limits<double>::is_iec559 && sizeof(double) == 8);

template <class Unsigned>
void put(std::vector<std::byte>& bytes, Unsigned value) {
  for (std::size_t i = 0; i < sizeof(Unsigned); ++i) {
    bytes.push_back(static_cast<std::byte>((value >> (8 * i)) & 0xffU));
  }
}

template <class Unsigned>
Unsigned take(std::span<const std::byte>& bytes) {
  Unsigned value = 0;
  for (std::size_t i = 0; i < sizeof(Unsigned); ++i) {
    value |= static_cast<Unsigned>(static_cast<Unsigned>(bytes[i]) << (8 * i));
  }
  bytes = bytes.subspan(sizeof(Unsigned));
  return value;
}

}  // namespace

std::vector<std::byte> pack_samples(std::span<const RawSample> samples) {
  std::vector<std::byte> bytes;
  bytes.reserve(samples.size() * kSampleBytes);
  for (const RawSample& sample : samples) {
    put(bytes, static_cast<std::uint64_t>(sample.counter));
    put(bytes, std::bit_cast<std::uint64_t>(sample.t_s));
    for (const std::int32_t code : sample.code) put(bytes, static_cast<std::uint32_t>(code));
    put(bytes, std::bit_cast<std::uint64_t>(sample.temp_C));
    bytes.push_back(static_cast<std::byte>(sample.status));
  }
  return bytes;
}

std::vector<RawSample> unpack_samples(std::span<const std::byte> bytes) {
  assert(bytes.size() % kSampleBytes == 0);
  std::vector<RawSample> samples(bytes.size() / kSampleBytes);
  for (RawSample& sample : samples) {
    sample.counter = static_cast<std::int64_t>(take<std::uint64_t>(bytes));
    sample.t_s = std::bit_cast<double>(take<std::uint64_t>(bytes));
    for (std::int32_t& code : sample.code) {
      code = static_cast<std::int32_t>(take<std::uint32_t>(bytes));
    }
    sample.temp_C = std::bit_cast<double>(take<std::uint64_t>(bytes));
    sample.status = std::to_integer<std::uint8_t>(bytes.front());
    bytes = bytes.subspan(1);
  }
  return samples;
}

}  // namespace plumbline::storage

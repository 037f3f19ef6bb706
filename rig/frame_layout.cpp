#include "rig/frame_layout.h"

#include <fmt/format.h>

#include <cassert>

namespace plumbline::rig {

namespace {

struct Found {
  const DbcMessage* message;
  const DbcSignal* signal;
};

Result<Found> find_signal(const Dbc& dbc, const std::string& role, const std::string& name) {
  const std::size_t dot = name.find('.');
  const auto refuse = [&](const std::string& why) {
    return fail(ErrorCode::input, fmt::format("signal {} = \"{}\": {}", role, name, why));
  };
  if (dot == std::string::npos) return refuse("must be MESSAGE.Signal");
  const DbcMessage* message = dbc.find(name.substr(0, dot));
  if (message == nullptr) {
    return refuse(fmt::format("the DBC file has no message {}", name.substr(0, dot)));
  }
  const DbcSignal* signal = message->find(name.substr(dot + 1));
  if (signal == nullptr) {
    return refuse(fmt::format("message {} has no signal {}", message->name, name.substr(dot + 1)));
  }
  return Found{message, signal};
}

bool same_id(const DbcMessage& message, const CanFrame& frame) {
  return message.id == frame.id && message.extended == frame.extended;
}

}  // namespace

std::uint8_t crc8(std::span<const std::uint8_t> bytes, std::uint8_t crc) {
  for (const std::uint8_t byte : bytes) {
    crc ^= byte;
    for (int i = 0; i < 8; ++i) {
      crc = static_cast<std::uint8_t>((crc & 0x80) != 0 ? (crc << 1) ^ 0x1D : crc << 1);
    }
  }
  return crc;
}

Result<FrameLayout> FrameLayout::bind(const Dbc& dbc, const SignalRoles& roles,
                                      const std::vector<CovariateSignal>& covariates) {
  FrameLayout layout;
  const auto first = find_signal(dbc, "counter_a", roles.counter_a);
  if (!first) return fail(first.error());
  const auto second = find_signal(dbc, "counter_b", roles.counter_b);
  if (!second) return fail(second.error());
  layout.first_ = *first->message;
  layout.second_ = *second->message;

  std::optional<Error> error;
  // Binds one role to a signal of `min_bits` to `max_bits` in one of the two messages.
  const auto bind_role = [&](const std::string& role, const std::string& name, int min_bits,
                             int max_bits) {
    Bound bound;
    const auto found = find_signal(dbc, role, name);
    const auto refuse = [&](const std::string& why) {
      if (!error) {
        error = Error{ErrorCode::input, fmt::format("signal {} = \"{}\": {}", role, name, why)};
      }
    };
    if (!found) {
      if (!error) error = found.error();
      return bound;
    }
    if (found->message->name != layout.first_.name && found->message->name != layout.second_.name) {
      refuse("is in neither of the messages with the counters");
    }
    if (found->signal->length < min_bits || found->signal->length > max_bits) {
      refuse(fmt::format("has {} bits where {} to {} are needed", found->signal->length, min_bits,
                         max_bits));
    }
    bound.in_second = !layout.one_message() && found->message->name == layout.second_.name;
    bound.signal = *found->signal;
    return bound;
  };
  const auto bind_optional = [&](const std::string& role, const std::string& name, int min_bits,
                                 int max_bits) -> std::optional<Bound> {
    if (name.empty()) return std::nullopt;
    return bind_role(role, name, min_bits, max_bits);
  };
  layout.counter_a_ = bind_role("counter_a", roles.counter_a, 8, 8);
  layout.counter_b_ = bind_role("counter_b", roles.counter_b, 8, 8);
  layout.counter_high_ = bind_role("counter_high", roles.counter_high, 8, 8);
  layout.code_[0] = bind_role("x", roles.x, 8, 32);
  layout.code_[1] = bind_role("y", roles.y, 8, 32);
  layout.code_[2] = bind_role("z", roles.z, 8, 32);
  layout.status_ = bind_optional("status", roles.status, 1, 8);
  layout.temp_ = bind_optional("temp", roles.temp, 1, 64);
  layout.crc_ = bind_optional("crc", roles.crc, 8, 8);
  if (!error && layout.crc_ &&
      layout.crc_->signal.start_bit % 8 != (layout.crc_->signal.little_endian ? 0 : 7)) {
    error =
        Error{ErrorCode::input, fmt::format("signal crc = \"{}\": must fill one byte", roles.crc)};
  }
  for (const CovariateSignal& covariate : covariates) {
    const auto found = find_signal(dbc, covariate.column, covariate.signal);
    if (!found) {
      if (!error) error = found.error();
      continue;
    }
    layout.covariates_.push_back(
        {covariate.column, found->message->id, found->message->extended, *found->signal});
  }
  if (error) return fail(*error);
  return layout;
}

FrameLayout::Kind FrameLayout::classify(const CanFrame& frame) const {
  if (frame.error || frame.remote) return Kind::foreign;
  if (same_id(first_, frame)) {
    if (one_message()) return frame.length >= first_.length ? Kind::both : Kind::damaged;
    if (frame.length == first_.length) return Kind::first;
    return frame.length == first_.length + second_.length ? Kind::both : Kind::damaged;
  }
  if (same_id(second_, frame)) {
    return frame.length == second_.length ? Kind::second : Kind::damaged;
  }
  return Kind::foreign;
}

SampleBytes FrameLayout::cut(const CanFrame& frame) const {
  const auto length = static_cast<std::size_t>(first_.length);
  if (one_message()) return {frame.bytes().first(length), {}};
  return {frame.bytes().first(length), frame.bytes().subspan(length)};
}

std::int64_t FrameLayout::raw(const Bound& bound, const SampleBytes& bytes) {
  const auto value = bound.signal.raw(bound.in_second ? bytes.second : bytes.first);
  assert(value);  // classify() has seen to the lengths
  return value.value_or(0);
}

std::uint8_t FrameLayout::counter_of_first(std::span<const std::uint8_t> bytes) const {
  return static_cast<std::uint8_t>(raw(counter_a_, {bytes, bytes}));
}

std::uint8_t FrameLayout::counter_of_second(std::span<const std::uint8_t> bytes) const {
  return static_cast<std::uint8_t>(raw(counter_b_, {bytes, bytes}));
}

std::uint8_t FrameLayout::checksum(const SampleBytes& bytes) const {
  const auto skip = static_cast<std::size_t>(crc_->signal.start_bit / 8);
  std::uint8_t crc = 0;
  for (const bool second : {false, true}) {
    const auto part = second ? bytes.second : bytes.first;
    if (second == crc_->in_second) {
      crc = crc8(part.subspan(skip + 1), crc8(part.first(skip), crc));
    } else {
      crc = crc8(part, crc);
    }
  }
  return crc;
}

std::optional<DecodedSample> FrameLayout::decode(const SampleBytes& bytes) const {
  if (crc_ && static_cast<std::uint8_t>(raw(*crc_, bytes)) != checksum(bytes)) return std::nullopt;
  DecodedSample decoded;
  decoded.counter = static_cast<std::uint16_t>(((raw(counter_high_, bytes) & 0xFF) << 8) |
                                               (raw(counter_b_, bytes) & 0xFF));
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    decoded.sample.code[i] = static_cast<std::int32_t>(raw(code_[i], bytes));
  }
  if (status_) decoded.sample.status = static_cast<std::uint8_t>(raw(*status_, bytes));
  if (temp_) {
    decoded.sample.temp_C =
        temp_->signal.physical(temp_->in_second ? bytes.second : bytes.first).value_or(0);
  }
  return decoded;
}

std::vector<FrameLayout::CovariateValue> FrameLayout::covariates(const CanFrame& frame) const {
  std::vector<CovariateValue> values;
  if (frame.error || frame.remote) return values;
  for (const BoundCovariate& covariate : covariates_) {
    if (covariate.id != frame.id || covariate.extended != frame.extended) continue;
    // A frame too short to hold the signal says nothing about it.
    if (const auto value = covariate.signal.physical(frame.bytes())) {
      values.push_back({&covariate.column, *value});
    }
  }
  return values;
}

}  // namespace plumbline::rig

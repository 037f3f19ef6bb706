// The node's CAN frames: samples and covariates to bytes. Pure; the layout is that of
// rig/dbc/plumbline.dbc, written out by hand here so that the reader of that file is held against
// something that does not share its code.
#pragma once

#include <linux/can.h>

#include <array>
#include <cstdint>
#include <span>

#include "rig/sim/unit.h"

namespace plumbline::sim {

inline constexpr canid_t kFrameA_id = 416;
inline constexpr canid_t kFrameB_id = 417;
inline constexpr canid_t kEnvironment_id = 418;
inline constexpr canid_t kIdentity_id = 419;

/// Bit 0 of the status byte: some code of the sample is at the end of its range.
inline constexpr std::uint8_t kStatusClipped = 0x01;

/// CRC-8 with polynomial x⁸+x⁴+x³+x²+1 (1Dh), most significant bit first, start value 0, no final
/// inversion; `crc` continues an earlier call.
std::uint8_t crc8(std::span<const std::uint8_t> bytes, std::uint8_t crc = 0);

/// Frames A and B of one sample; B closes with the CRC over A's 8 bytes and its own first 7.
std::array<can_frame, 2> encode_sample(const NodeSample& sample);

/// Humidity, supply voltage and motor current beside the samples.
can_frame encode_environment(const NodeSample& sample);

/// The node's serial number.
can_frame encode_identity(std::uint32_t serial_number);

}  // namespace plumbline::sim

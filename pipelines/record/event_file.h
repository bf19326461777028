// TensorFlow's files of events, which TensorBoard shows: records with checksums, each a message `Event`.
//
// Only what is written here is known of them. The messages are of Protocol Buffers, written by hand as they are few;
// names and numbers of their fields are those of event.proto, summary.proto and tensor.proto in
// tensorboard/compat/proto and of plugin_data.proto in tensorboard/plugins/hparams.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "core/config_value.h"

namespace hsi4d {

/// CRC-32C of bytes: Castagnoli's polynomial 0x1edc6f41, bits reflected.   [RFC 3720, 12.1 and B.4]
std::uint32_t crc32c(std::string_view bytes);

/// A record of such a file: the length of `data` in eight bytes, the checksum of these, `data`, its checksum, all
/// little-endian. A checksum is the CRC-32C c as (c ≫ 15 | c ≪ 17) + 0xa282ead8, so that data may hold CRCs
/// themselves.   [tensorflow/core/lib/hash/crc32c.h]
std::string event_record(std::string_view data);

/// When something was.
struct EventTime {
  double seconds = 0;     ///< since 1970, UTC
  std::int64_t step = 0;  ///< what curves are drawn over
};

/// The event that a file begins with.
std::string version_event(double seconds);

/// Numbers by tag, each rounded to a float.
std::string scalars_event(EventTime time, std::span<const std::pair<std::string, double>> scalars);

/// An image, the bytes of its PNG as they are. Throws InternalError for what is no PNG.
std::string image_event(EventTime time, std::string_view tag, std::span<const std::uint8_t> png);

/// The settings that a run is told by among others (TensorBoard's HPARAMS).
/// @param settings  an object; members that are no numbers, booleans or strings are shown as JSON text
std::string hparams_event(double seconds, const ConfigValue& settings);

}  // namespace hsi4d

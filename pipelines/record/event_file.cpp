#include "pipelines/record/event_file.h"

#include <array>
#include <bit>

#include "core/check.h"
#include "core/json_text.h"
#include "core/png.h"

namespace hsi4d {
namespace {

using Kind = ConfigValue::Kind;

// ---- Records ----

/// What a byte does to a checksum.
constexpr std::array<std::uint32_t, 256> crc_table() {
  std::array<std::uint32_t, 256> table{};
  for (std::uint32_t byte = 0; byte < 256; ++byte) {
    std::uint32_t crc = byte;
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ ((crc & 1) != 0 ? 0x82f63b78u : 0);  // 0x1edc6f41, reflected
    table[byte] = crc;
  }
  return table;
}

constexpr std::array<std::uint32_t, 256> kCrcTable = crc_table();

void append_little_endian(std::string& text, std::uint64_t value, int bytes) {
  for (int i = 0; i < bytes; ++i) text += static_cast<char>(value >> (8 * i));
}

std::uint32_t masked_crc(std::string_view bytes) { return std::rotr(crc32c(bytes), 15) + 0xa282ead8u; }

// ---- Messages of Protocol Buffers ----

/// A message, field by field. A field begins with its number and the way in which it is written.
class EventMessage {
 public:
  EventMessage& whole(int field, std::int64_t value) {
    begin(field, 0);
    append_varint(static_cast<std::uint64_t>(value));
    return *this;
  }
  EventMessage& real(int field, double value) {
    begin(field, 1);
    append_little_endian(text_, std::bit_cast<std::uint64_t>(value), 8);
    return *this;
  }
  EventMessage& real(int field, float value) {
    begin(field, 5);
    append_little_endian(text_, std::bit_cast<std::uint32_t>(value), 4);
    return *this;
  }
  EventMessage& bytes(int field, std::string_view value) {
    begin(field, 2);
    append_varint(value.size());
    text_ += value;
    return *this;
  }
  EventMessage& message(int field, const EventMessage& value) { return bytes(field, value.text_); }

  const std::string& text() const { return text_; }

 private:
  void begin(int field, int wire_type) { append_varint(static_cast<std::uint64_t>(field * 8 + wire_type)); }

  /// Seven bits a byte, the lowest first; all bytes but the last have the highest bit.
  void append_varint(std::uint64_t value) {
    for (; value >= 0x80; value >>= 7) text_ += static_cast<char>((value & 0x7f) | 0x80);
    text_ += static_cast<char>(value);
  }

  std::string text_;
};

EventMessage event_at(EventTime time) {
  return EventMessage().real(/*wall_time*/ 1, time.seconds).whole(/*step*/ 2, time.step);
}

/// @param summary  with fields 1, each a value with its tag
std::string summary_event(EventTime time, const EventMessage& summary) {
  return event_at(time).message(/*summary*/ 5, summary).text();
}

// ---- Images ----

constexpr std::size_t kPngHeader = 26;  // up to the colour type: signature, then length, name and most of IHDR

std::int64_t png_size(std::span<const std::uint8_t> png, std::size_t at) {
  std::int64_t size = 0;
  for (std::size_t i = 0; i < 4; ++i) size = size * 256 + png[at + i];
  return size;
}

/// The channels that TensorFlow's number of a colour space stands for: grey, grey and alpha, RGB, RGBA.
int png_channels(std::span<const std::uint8_t> png) {
  const int type = png[25];
  return type == 0 ? 1 : type == 4 ? 2 : type == 6 ? 4 : 3;
}

// ---- Settings ----

/// google.protobuf.Value.
EventMessage value_message(const ConfigValue& value) {
  if (value.kind == Kind::kNumber) return EventMessage().real(2, number_of(value, ""));
  if (value.kind == Kind::kBoolean) return EventMessage().whole(4, value.boolean ? 1 : 0);
  return EventMessage().bytes(3, value.kind == Kind::kString ? value.text : to_json_line(value));
}

/// SummaryMetadata of the plugin HPARAMS, whose values are in it.
EventMessage hparams_metadata(double seconds, const ConfigValue& settings) {
  EventMessage start;  // SessionStartInfo
  for (const ConfigMember& member : settings.members)
    start.message(/*hparams*/ 1, EventMessage().bytes(1, member.key).message(2, value_message(member.value)));
  start.real(/*start_time_secs*/ 5, seconds);
  const EventMessage plugin =
      EventMessage().bytes(/*plugin_name*/ 1, "hparams").message(/*content*/ 2, EventMessage().message(3, start));
  return EventMessage().message(/*plugin_data*/ 1, plugin).whole(/*data_class*/ 4, /*tensor*/ 2);
}

/// A tensor of no floats: its value is in its metadata.
EventMessage empty_tensor() {
  const EventMessage axis_of_length_0;
  return EventMessage().whole(/*dtype*/ 1, 1).message(/*tensor_shape*/ 2, EventMessage().message(2, axis_of_length_0));
}

}  // namespace

std::uint32_t crc32c(std::string_view bytes) {
  std::uint32_t crc = 0xffffffffu;
  for (const char byte : bytes) crc = (crc >> 8) ^ kCrcTable[(crc ^ static_cast<std::uint8_t>(byte)) & 0xff];
  return ~crc;
}

std::string event_record(std::string_view data) {
  std::string record;
  record.reserve(data.size() + 16);
  append_little_endian(record, data.size(), 8);
  append_little_endian(record, masked_crc(record), 4);
  record += data;
  append_little_endian(record, masked_crc(data), 4);
  return record;
}

std::string version_event(double seconds) {
  return EventMessage().real(/*wall_time*/ 1, seconds).bytes(/*file_version*/ 3, "brain.Event:2").text();
}

std::string scalars_event(EventTime time, std::span<const std::pair<std::string, double>> scalars) {
  EventMessage summary;
  for (const auto& [tag, value] : scalars)
    summary.message(1, EventMessage().bytes(/*tag*/ 1, tag).real(/*simple_value*/ 2, static_cast<float>(value)));
  return summary_event(time, summary);
}

std::string image_event(EventTime time, std::string_view tag, std::span<const std::uint8_t> png) {
  HSI4D_CHECK(png.size() >= kPngHeader && is_png(png.first(8)), std::string(tag) + ": is no PNG");
  EventMessage image;
  image.whole(/*height*/ 1, png_size(png, 20)).whole(/*width*/ 2, png_size(png, 16));
  image.whole(/*colorspace*/ 3, png_channels(png));
  image.bytes(/*encoded_image_string*/ 4, {reinterpret_cast<const char*>(png.data()), png.size()});
  return summary_event(time, EventMessage().message(1, EventMessage().bytes(/*tag*/ 1, tag).message(4, image)));
}

std::string hparams_event(double seconds, const ConfigValue& settings) {
  EventMessage value;
  value.bytes(/*tag*/ 1, "_hparams_/session_start_info");
  value.message(/*tensor*/ 8, empty_tensor()).message(/*metadata*/ 9, hparams_metadata(seconds, settings));
  return summary_event({seconds, 0}, EventMessage().message(1, value));
}

}  // namespace hsi4d

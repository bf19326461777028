#include "optim/checkpoint.h"

#include "core/npz.h"

namespace hsi4d {

namespace {

constexpr const char* kFormatKey = "format";
constexpr const char* kVersionKey = "version";
constexpr const char* kHashKey = "config_hash";

bool is_reserved(std::string_view name) { return name == kFormatKey || name == kVersionKey || name == kHashKey; }

[[noreturn]] void refuse(const std::string& source, const std::string& problem) {
  throw DataError(source + ": " + problem);
}

/// Throws unless the file says that it is a checkpoint of this config that this version can read.
void check_header(const Npz& file, const std::string& config_hash) {
  const std::string& source = file.source();
  if (!file.has(kFormatKey) || !file.has(kVersionKey) || !file.has(kHashKey))
    refuse(source, std::string("not an ") + Checkpoint::kFormat + ": format, version or config_hash is missing");
  const std::string format = file.array(kFormatKey).text();
  if (format != Checkpoint::kFormat)
    refuse(source, "its format is '" + format + "'; '" + Checkpoint::kFormat + "' is needed");
  const std::int64_t version = file.array(kVersionKey).scalar<std::int64_t>();
  if (version < 1 || version > Checkpoint::kVersion) {
    refuse(source, "version " + std::to_string(version) +
                       " of the checkpoint format; this program reads up to version " +
                       std::to_string(Checkpoint::kVersion));
  }
  const std::string hash = file.array(kHashKey).text();
  if (hash != config_hash) {
    refuse(source, "made with another config (hash " + hash + ", now " + config_hash +
                       "); go on with the config that the run began with, or begin anew");
  }
}

Checkpoint::Value value_of(const NpyArray& array) {
  const std::string& dtype = array.dtype();
  if (array.kind() == NpyKind::unicode && array.shape().empty()) return array.text();
  if (array.shape().size() == 1 && dtype == "<f8") return array.as<double>();
  if (array.shape().size() == 1 && dtype == "<f4") return array.as<float>();
  if (array.shape().size() == 1 && dtype == "<i8") return array.as<std::int64_t>();
  refuse(array.source(), "shape " + shape_text(array.shape()) + " and dtype '" + dtype +
                             "'; a checkpoint has texts and vectors of float64, float32 and int64");
}

struct AddTo {
  NpzWriter& file;
  const std::string& name;
  void operator()(const std::string& text) const { file.add_text(name, text); }
  template <class T>
  void operator()(const std::vector<T>& values) const {
    file.add<T>(name, {static_cast<std::int64_t>(values.size())}, values);
  }
};

}  // namespace

void Checkpoint::set(const std::string& name, Value value) {
  HSI4D_CHECK(!name.empty() && !is_reserved(name), "the name '" + name + "' can not be an entry of a checkpoint");
  entries_.insert_or_assign(name, std::move(value));
}

std::vector<std::string> Checkpoint::names() const {
  std::vector<std::string> names;
  for (const auto& [name, value] : entries_) names.push_back(name);
  return names;
}

template <class T>
const T& Checkpoint::entry(std::string_view name, const char* type) const {
  const auto found = entries_.find(name);
  if (found == entries_.end()) refuse(source_, "it has no entry '" + std::string(name) + "'");
  const T* value = std::get_if<T>(&found->second);
  if (value == nullptr) refuse(source_, "its entry '" + std::string(name) + "' is not " + type);
  return *value;
}

const std::vector<double>& Checkpoint::doubles(std::string_view name) const {
  return entry<std::vector<double>>(name, "a vector of float64");
}
const std::vector<float>& Checkpoint::floats(std::string_view name) const {
  return entry<std::vector<float>>(name, "a vector of float32");
}
const std::vector<std::int64_t>& Checkpoint::integers(std::string_view name) const {
  return entry<std::vector<std::int64_t>>(name, "a vector of int64");
}
const std::string& Checkpoint::text(std::string_view name) const { return entry<std::string>(name, "a text"); }

Bytes Checkpoint::encode(const std::string& config_hash) const {
  NpzWriter file;
  file.add_text(kFormatKey, kFormat);
  file.add_scalar<std::int64_t>(kVersionKey, kVersion);
  file.add_text(kHashKey, config_hash);
  for (const auto& [name, value] : entries_) std::visit(AddTo{file, name}, value);
  return file.encode();
}

void Checkpoint::save(const std::string& path, const std::string& config_hash) const {
  write_file(path, encode(config_hash));
}

Checkpoint decode_checkpoint(std::span<const uint8_t> bytes, const std::string& source,
                             const std::string& config_hash) {
  const Npz file = Npz::decode(bytes, source);
  check_header(file, config_hash);
  if (!file.skipped().empty()) refuse(source, "its entry '" + file.skipped()[0].name + "' " + file.skipped()[0].reason);
  Checkpoint checkpoint;
  checkpoint.source_ = source;
  for (const std::string& name : file.names()) {
    if (!is_reserved(name)) checkpoint.entries_.insert_or_assign(name, value_of(file.array(name)));
  }
  return checkpoint;
}

Checkpoint load_checkpoint(const std::string& path, const std::string& config_hash) {
  return decode_checkpoint(read_file(path), path, config_hash);
}

std::string text_hash(std::string_view text) {
  std::uint64_t hash = 0xcbf29ce484222325u;
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3u;
  std::string digits(16, '0');
  for (std::size_t i = 16; i-- > 0; hash >>= 4) digits[i] = "0123456789abcdef"[hash & 15u];
  return digits;
}

// prefix/groups: names, one a line; prefix/GROUP/steps; prefix/GROUP/BLOCK/mean and square.
void store_moments(const AdamState& state, const std::string& prefix, Checkpoint& checkpoint) {
  std::string names;
  for (const auto& [name, moments] : state) {
    names += name + "\n";
    const std::string group = prefix + "/" + name;
    checkpoint.set(group + "/steps", std::vector<std::int64_t>{moments.steps, std::ssize(moments.blocks)});
    for (std::size_t b = 0; b < moments.blocks.size(); ++b) {
      const std::string block = group + "/" + std::to_string(b);
      checkpoint.set(block + "/mean", moments.blocks[b].mean);
      checkpoint.set(block + "/square", moments.blocks[b].square);
    }
  }
  checkpoint.set(prefix + "/groups", names);
}

AdamState stored_moments(const Checkpoint& checkpoint, const std::string& prefix) {
  AdamState state;
  if (!checkpoint.has(prefix + "/groups")) return state;
  const std::string& names = checkpoint.text(prefix + "/groups");
  for (std::size_t begin = 0, end; (end = names.find('\n', begin)) != std::string::npos; begin = end + 1) {
    const std::string name = names.substr(begin, end - begin), group = prefix + "/" + name;
    const std::vector<std::int64_t>& counts = checkpoint.integers(group + "/steps");
    if (counts.size() != 2 || counts[0] < 0 || counts[1] < 0)
      refuse(checkpoint.source(), "its entry '" + group + "/steps' is not two counts");
    GroupMoments& moments = state[name];
    moments.steps = counts[0];
    for (std::int64_t b = 0; b < counts[1]; ++b) {
      const std::string block = group + "/" + std::to_string(b);
      moments.blocks.push_back({checkpoint.doubles(block + "/mean"), checkpoint.doubles(block + "/square")});
    }
  }
  return state;
}

}  // namespace hsi4d

// Checkpoints: named numbers and texts that a run goes on from, in one .npz file.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "core/file.h"
#include "optim/adam.h"

namespace hsi4d {

/// Named vectors of double, float or int64 and named texts. Saved and loaded bit for bit: NaN payloads, −0 and
/// denormals too.
///
/// In the file: `format` ("hsi4d checkpoint"), `version`, `config_hash`, and each entry under its name.
class Checkpoint {
 public:
  static constexpr const char* kFormat = "hsi4d checkpoint";
  static constexpr std::int64_t kVersion = 1;

  using Value = std::variant<std::vector<double>, std::vector<float>, std::vector<std::int64_t>, std::string>;

  /// Sets an entry. Throws InternalError for an empty name, or one of the three names of the file's own.
  void set(const std::string& name, Value value);

  bool has(std::string_view name) const { return entries_.contains(name); }
  /// Names of the entries, sorted.
  std::vector<std::string> names() const;

  /// The entry of that name. Throws DataError naming the file (after loading) and the entry: absent, of another type.
  const std::vector<double>& doubles(std::string_view name) const;
  const std::vector<float>& floats(std::string_view name) const;
  const std::vector<std::int64_t>& integers(std::string_view name) const;
  const std::string& text(std::string_view name) const;

  /// What messages call it: the file's path after loading.
  const std::string& source() const { return source_; }

  /// Writes the file in one step: a reader finds the old checkpoint or the new one, never a part.
  /// @param config_hash  of the config that the state belongs to (text_hash)
  /// Throws UserError naming the path when it cannot be written.
  void save(const std::string& path, const std::string& config_hash) const;
  Bytes encode(const std::string& config_hash) const;

 private:
  friend Checkpoint decode_checkpoint(std::span<const uint8_t>, const std::string&, const std::string&);
  template <class T>
  const T& entry(std::string_view name, const char* type) const;

  std::map<std::string, Value, std::less<>> entries_;
  std::string source_ = "checkpoint";
};

/// Reads a checkpoint.
///
/// @param config_hash  of the config of the run that is to go on
/// Throws UserError when the file cannot be read; DataError naming it: another format, a newer version, made with
/// another config, damaged (see Npz), or an entry of a type that checkpoints do not have.
Checkpoint load_checkpoint(const std::string& path, const std::string& config_hash);
/// As load_checkpoint, of a file in memory that messages call `source`.
Checkpoint decode_checkpoint(std::span<const uint8_t> file, const std::string& source, const std::string& config_hash);

/// Sixteen hexadecimal digits that tell texts apart (FNV-1a, 64 bits): against mistakes, not against attacks.
std::string text_hash(std::string_view text);

/// Puts moments into a checkpoint, under names that begin with `prefix`.
void store_moments(const AdamState& state, const std::string& prefix, Checkpoint& checkpoint);
/// The moments that store_moments put there, empty when none were. Throws DataError as Checkpoint's readers.
AdamState stored_moments(const Checkpoint& checkpoint, const std::string& prefix);

}  // namespace hsi4d

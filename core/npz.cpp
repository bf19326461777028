#include "core/npz.h"

#include <algorithm>
#include <memory>
#include <set>

#include <zip.h>

#include "core/check.h"
#include "core/file_kind.h"
#include "core/text.h"

namespace hsi4d {
namespace {

constexpr std::string_view kEnding = ".npy";
constexpr zip_uint16_t kDate = 1 << 5 | 1;  // the first of January 1980, where zip's dates begin, as numpy has it
constexpr zip_uint32_t kAttributes = 0100644u << 16;

using Archive = std::unique_ptr<zip_t, decltype([](zip_t* archive) { zip_discard(archive); })>;
using Member = std::unique_ptr<zip_file_t, decltype([](zip_file_t* file) { zip_fclose(file); })>;
using ZipSource = std::unique_ptr<zip_source_t, decltype([](zip_source_t* source) { zip_source_free(source); })>;

struct ZipError {
  zip_error_t value;
  ZipError() { zip_error_init(&value); }
  ~ZipError() { zip_error_fini(&value); }
  ZipError(const ZipError&) = delete;
  ZipError& operator=(const ZipError&) = delete;
  std::string text() { return zip_error_strerror(&value); }
};

[[noreturn]] void fail_npz(const std::string& source, const std::string& reason) {
  throw DataError(source + ": " + reason);
}

// Reading -------------------------------------------------------------------------------------------------------------

bool is_zip(std::span<const uint8_t> file) { return file.size() > 1 && file[0] == 'P' && file[1] == 'K'; }

Archive open_archive(std::span<const uint8_t> file, const std::string& source) {
  ZipError error;
  ZipSource buffer(zip_source_buffer_create(file.data(), file.size(), 0, &error.value));
  if (!buffer) throw InternalError(source + ": " + error.text());
  Archive archive(zip_open_from_source(buffer.get(), ZIP_RDONLY, &error.value));
  if (!archive) {
    const std::string other = is_zip(file) ? "" : other_kind(file, "a .npz archive");
    fail_npz(source, other.empty() ? "cannot be read as a zip archive: " + error.text() : other);
  }
  buffer.release();  // the archive owns it now
  return archive;
}

/// What a member claims, checked against what the archive can hold before memory is taken for it.
zip_stat_t checked_stat(zip_t* archive, zip_uint64_t index, int64_t file_bytes, const std::string& label) {
  zip_stat_t stat;
  if (zip_stat_index(archive, index, 0, &stat) != 0) fail_npz(label, zip_strerror(archive));
  if (stat.encryption_method != ZIP_EM_NONE) fail_npz(label, "is encrypted, which is not read");
  if (stat.comp_method != ZIP_CM_STORE && stat.comp_method != ZIP_CM_DEFLATE) {
    fail_npz(label,
             "is packed by method " + std::to_string(stat.comp_method) + "; stored and deflated members are read");
  }
  // Deflate packs 1032 to 1 at best.
  const zip_uint64_t densest = stat.comp_method == ZIP_CM_STORE ? 1 : 1040;
  if (stat.comp_size > static_cast<zip_uint64_t>(file_bytes) || stat.size / densest > stat.comp_size + 64) {
    fail_npz(label, "claims " + std::to_string(stat.size) + " bytes packed as " + std::to_string(stat.comp_size) +
                        " in a file of " + std::to_string(file_bytes));
  }
  return stat;
}

Bytes read_member(zip_t* archive, const zip_stat_t& stat, const std::string& label) {
  const Member member(zip_fopen_index(archive, stat.index, 0));
  if (!member) fail_npz(label, zip_strerror(archive));
  Bytes content(stat.size);
  constexpr size_t kMostAtOnce = size_t{1} << 30;  // libzip 1.7 miscounts what it unpacks beyond 2^32 bytes in one call
  size_t done = 0;
  while (done < content.size()) {
    const zip_uint64_t wanted = std::min(kMostAtOnce, content.size() - done);
    const zip_int64_t got = zip_fread(member.get(), content.data() + done, wanted);
    if (got < 0) fail_npz(label, std::string("cannot be unpacked: ") + zip_file_strerror(member.get()));
    if (got == 0) break;
    done += static_cast<size_t>(got);
  }
  // The checksum is tested when the end is read.
  uint8_t beyond;
  const zip_int64_t got = zip_fread(member.get(), &beyond, 1);
  if (got < 0) fail_npz(label, std::string("cannot be unpacked: ") + zip_file_strerror(member.get()));
  if (got > 0 || done != content.size()) {
    fail_npz(label, "unpacks to " + std::string(got > 0 ? "more" : "fewer") + " than the " + std::to_string(stat.size) +
                        " bytes that it claims");
  }
  return content;
}

}  // namespace

Npz Npz::read(const std::string& path, int64_t max_bytes) { return decode(read_file(path), path, max_bytes); }

Npz Npz::decode(std::span<const uint8_t> file, const std::string& source, int64_t max_bytes) {
  if (file.empty()) fail_npz(source, "is empty");  // to libzip an archive without members
  const Archive archive = open_archive(file, source);
  Npz npz;
  npz.source_ = source;
  std::set<std::string, std::less<>> seen;
  zip_uint64_t packed = 0, unpacked = 0;
  const zip_int64_t count = zip_get_num_entries(archive.get(), 0);
  for (zip_int64_t i = 0; i < count; ++i) {
    const char* raw_name = zip_get_name(archive.get(), i, 0);
    if (raw_name == nullptr) fail_npz(source, "member " + std::to_string(i) + ": " + zip_strerror(archive.get()));
    std::string name = raw_name;
    const bool is_array = name.ends_with(kEnding);
    if (is_array) name.resize(name.size() - kEnding.size());
    if (!seen.insert(raw_name).second) fail_npz(source, "holds '" + std::string(raw_name) + "' twice");
    if (!is_array) {
      npz.skipped_.push_back({name, "is no .npy member"});
      continue;
    }
    const std::string label = source + ": array '" + name + "'";
    const zip_stat_t stat = checked_stat(archive.get(), i, std::ssize(file), label);
    // Members that share packed bytes would unpack to more than any one of them shows.
    packed += stat.comp_size;
    unpacked += stat.size;
    if (packed > file.size()) fail_npz(label, "shares its bytes with another member");
    if (unpacked > static_cast<zip_uint64_t>(max_bytes)) {
      fail_npz(label, "brings the arrays to " + std::to_string(unpacked) + " bytes; at most " +
                          std::to_string(max_bytes) + " are read");
    }
    NpyResult result = decode_npy(read_member(archive.get(), stat, label), label);
    if (result.array) {
      npz.names_.push_back(name);
      npz.arrays_.emplace(name, std::move(*result.array));
    } else {
      npz.skipped_.push_back({name, result.unread_reason});
    }
  }
  return npz;
}

const NpyArray& Npz::array(std::string_view name) const {
  const auto found = arrays_.find(name);
  if (found != arrays_.end()) return found->second;
  const auto skip = std::ranges::find(skipped_, name, &Skipped::name);
  if (skip != skipped_.end()) fail_npz(source_, "array '" + std::string(name) + "': " + skip->reason);
  fail_npz(source_,
           "has no array '" + std::string(name) + "'; there are: " + (names_.empty() ? "none" : joined(names_)));
}

// Writing -------------------------------------------------------------------------------------------------------------

namespace {

/// Adds the members and closes the archive, which is when libzip writes. Returns its complaint, or "".
std::string write_archive(Archive archive, const std::vector<std::pair<std::string, Bytes>>& members,
                          NpzPacking packing) {
  const zip_int32_t method = packing == NpzPacking::stored ? ZIP_CM_STORE : ZIP_CM_DEFLATE;
  for (const auto& [name, content] : members) {
    ZipSource content_source(zip_source_buffer(archive.get(), content.data(), content.size(), 0));
    if (!content_source) return zip_strerror(archive.get());
    const zip_int64_t index =
        zip_file_add(archive.get(), (name + std::string(kEnding)).c_str(), content_source.get(), ZIP_FL_ENC_UTF_8);
    if (index < 0) return zip_strerror(archive.get());
    content_source.release();  // the archive owns it now
    if (zip_set_file_compression(archive.get(), index, method, 0) != 0 ||
        zip_file_set_dostime(archive.get(), index, 0, kDate, 0) != 0 ||
        zip_file_set_external_attributes(archive.get(), index, 0, ZIP_OPSYS_UNIX, kAttributes) != 0) {
      return zip_strerror(archive.get());
    }
  }
  if (zip_close(archive.get()) != 0) return zip_strerror(archive.get());
  archive.release();
  return "";
}

/// An archive without members, which libzip would not write at all.
Bytes empty_archive() {
  Bytes content(22, 0);
  std::ranges::copy(std::string_view("PK\5\6"), content.begin());
  return content;
}

Bytes unpacked(zip_source_t* source) {
  zip_stat_t stat;
  HSI4D_CHECK(zip_source_stat(source, &stat) == 0 && zip_source_open(source) == 0, "an archive in memory");
  Bytes content(stat.size);
  const zip_int64_t got = zip_source_read(source, content.data(), content.size());
  zip_source_close(source);
  HSI4D_CHECK_EQ(got, std::ssize(content));
  return content;
}

}  // namespace

void NpzWriter::add_member(const std::string& name, Bytes content) {
  HSI4D_CHECK(!name.empty() && name.find('\0') == std::string::npos, "array name '" + name + "'");
  HSI4D_CHECK(names_.insert(name).second, "array '" + name + "' is there twice");
  members_.emplace_back(name, std::move(content));
}

void NpzWriter::add_text(const std::string& name, const std::string& text) {
  add_member(name, encode_npy({}, std::span(&text, 1)));
}

void NpzWriter::add_texts(const std::string& name, std::span<const std::string> texts) {
  const int64_t count = std::ssize(texts);
  add_member(name, encode_npy(std::span(&count, 1), texts));
}

Bytes NpzWriter::encode(NpzPacking packing) const {
  if (members_.empty()) return empty_archive();
  ZipError error;
  const ZipSource source(zip_source_buffer_create(nullptr, 0, 0, &error.value));
  HSI4D_CHECK(source != nullptr, error.text());
  zip_source_keep(source.get());  // closing the archive frees its share
  Archive archive(zip_open_from_source(source.get(), ZIP_TRUNCATE, &error.value));
  HSI4D_CHECK(archive != nullptr, error.text());
  const std::string complaint = write_archive(std::move(archive), members_, packing);
  HSI4D_CHECK(complaint.empty(), complaint);
  return unpacked(source.get());
}

void NpzWriter::write(const std::string& path, NpzPacking packing) const {
  if (members_.empty()) return write_file(path, empty_archive());
  AtomicFile file(path);
  int code = 0;
  Archive archive(zip_open(file.temporary_path().c_str(), ZIP_CREATE | ZIP_TRUNCATE, &code));
  ZipError error;
  zip_error_init_with_code(&error.value, code);
  if (!archive) throw UserError(path + ": cannot be written: " + error.text());
  const std::string complaint = write_archive(std::move(archive), members_, packing);
  if (!complaint.empty()) throw UserError(path + ": cannot be written: " + complaint);
  file.commit();
}

}  // namespace hsi4d

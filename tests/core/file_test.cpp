#include "core/file.h"

#include <fstream>
#include <sys/stat.h>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "stress/scratch_folder.h"

namespace file_test {

using namespace hsi4d;

namespace {

std::string message_of(auto&& action) {
  try {
    action();
  } catch (const UserError& error) {
    return error.what();
  }
  return "no UserError";
}

}  // namespace

TEST_CASE("what is written is what is read, byte for byte") {
  const ScratchFolder folder;
  for (const size_t size : {0u, 1u, 65536u, 200001u}) {
    Bytes content(size);
    for (size_t i = 0; i < size; ++i) content[i] = static_cast<uint8_t>(i * 131 + i / 251);
    write_file(folder / "a.bin", content);
    CHECK(read_file(folder / "a.bin") == content);
    CHECK(read_file_start(folder / "a.bin", 5) == Bytes(content.begin(), content.begin() + std::min<size_t>(5, size)));
  }
  const std::string text("line\r\n\0\xc3\xa4", 9);
  write_text_file(folder / "\xc3\xa4 b.txt", text);
  CHECK(read_text_file(folder / "\xc3\xa4 b.txt") == text);
  CHECK(folder.count() == 2);
}

TEST_CASE("a file without a size is read to its end") {
  CHECK(read_text_file("/proc/self/status").starts_with("Name:"));
}

TEST_CASE("reading names the path and the reason") {
  const ScratchFolder folder;
  const std::string absent = folder / "absent";
  CHECK(message_of([&] { read_file(absent); }) == absent + ": cannot be read: No such file or directory");
  CHECK(message_of([&] { read_text_file(folder.path()); }) == folder.path() + ": cannot be read: it is a folder");
  write_text_file(folder / "six", "123456");
  CHECK(message_of([&] { read_file(folder / "six", 5); }) == folder / "six" + ": has 6 bytes; at most 5 are read");
  CHECK(read_file(folder / "six", 6).size() == 6);
  CHECK(read_file_start(folder / "six", 2).size() == 2);
  CHECK(message_of([&] { read_file("/proc/self/status", 5); }) ==
        "/proc/self/status: has more than the 5 bytes that are read");
}

TEST_CASE("an atomic file appears at commit and leaves nothing behind otherwise") {
  const ScratchFolder folder;
  const std::string path = folder / "result";
  write_text_file(path, "old");
  {
    AtomicFile file(path);
    CHECK(std::filesystem::path(file.temporary_path()).parent_path() == folder.path());
    file.append(Bytes{'n', 'e'});
    CHECK(read_text_file(path) == "old");
    CHECK(folder.count() == 2);
  }
  CHECK(read_text_file(path) == "old");
  CHECK(folder.count() == 1);
  {
    AtomicFile file(path);
    AtomicFile other(path);
    CHECK(other.temporary_path() != file.temporary_path());
    file.append(Bytes{'n', 'e'});
    file.append(Bytes{'w'});
    file.commit();
    CHECK(read_text_file(path) == "new");
    CHECK_THROWS_WITH(file.commit(), Catch::Contains("was committed before"));
  }
  CHECK(read_text_file(path) == "new");
  CHECK(folder.count() == 1);
}

TEST_CASE("writing follows a link and refuses what is no file") {
  const ScratchFolder folder;
  write_text_file(folder / "target", "old");
  std::filesystem::create_symlink(folder / "target", folder / "link");
  write_text_file(folder / "link", "new");
  CHECK(std::filesystem::is_symlink(folder / "link"));
  CHECK(read_text_file(folder / "target") == "new");

  CHECK(message_of([&] { write_text_file(folder.path(), ""); }) ==
        folder.path() + ": cannot be written: it is a folder");
  REQUIRE(::mkfifo((folder / "pipe").c_str(), 0600) == 0);
  CHECK(message_of([&] { write_text_file(folder / "pipe", ""); }) ==
        folder / "pipe" + ": cannot be written: it is no file");
  const std::string below_file = folder / "target/no/where";
  CHECK(message_of([&] { write_text_file(below_file, ""); }) == below_file + ": cannot be written: Not a directory");
}

TEST_CASE("folders on the way to a file are made") {
  const ScratchFolder folder;
  write_text_file(folder / "a/b/text", "text");
  CHECK(read_text_file(folder / "a/b/text") == "text");
  const std::string denied = "/proc/nowhere/text";
  CHECK(message_of([&] { write_text_file(denied, ""); }) ==
        denied + ": cannot be written: the folder /proc/nowhere cannot be made: No such file or directory");
}

TEST_CASE("new files get the usual permissions") {
  const ScratchFolder folder;
  write_text_file(folder / "ours", "");
  std::ofstream(folder / "theirs").put('x');
  CHECK(std::filesystem::status(folder / "ours").permissions() ==
        std::filesystem::status(folder / "theirs").permissions());
}

TEST_CASE("a path is meant from the folder of the file that names it") {
  CHECK(path_beside("runs/a/config.json", "scene.ply") == "runs/a/scene.ply");
  CHECK(path_beside("runs/a/config.json", "../scene.ply") == "runs/scene.ply");
  CHECK(path_beside("config.json", "scene.ply") == "scene.ply");
  CHECK(path_beside("/runs/config.json", "/data/scene.ply") == "/data/scene.ply");
}

}  // namespace file_test

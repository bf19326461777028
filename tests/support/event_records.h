// What is in a file of events (pipelines/record/event_file.h), as far as tests that compare such files need to know.
#pragma once

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "pipelines/record/event_file.h"
#include "tests/support/temporary_folder.h"

namespace hsi4d::test {

/// The messages of a file, whose checksums must be right and which must end with a record.
inline std::vector<std::string> messages_in(const std::filesystem::path& file) {
  const std::string text = file_text(file);
  std::vector<std::string> messages;
  for (std::size_t begin = 0; begin < text.size();) {
    REQUIRE(text.size() >= begin + 16);
    std::uint64_t length = 0;
    std::memcpy(&length, text.data() + begin, 8);
    REQUIRE(length <= text.size() - begin - 16);
    messages.push_back(text.substr(begin + 12, length));
    REQUIRE(event_record(messages.back()) == text.substr(begin, length + 16));
    begin += length + 16;
  }
  return messages;
}

/// The only file of events of a run.
inline std::filesystem::path events_file_of(const std::filesystem::path& run) {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(run / "tensorboard")) files.push_back(entry.path());
  REQUIRE(files.size() == 1);
  CHECK_THAT(files[0].filename().string(),
             Catch::Matchers::StartsWith("events.out.tfevents.") && Catch::Matchers::EndsWith(".hsi4d"));
  return files[0];
}

/// A message without its time, with which each begins.
inline std::string without_time(const std::string& message) {
  REQUIRE(message.size() >= 9);
  REQUIRE(message[0] == '\x09');
  return message.substr(9);
}

/// What a run shows, without times: the same however the run came about.
inline std::vector<std::string> events_of_run(const std::filesystem::path& run) {
  std::vector<std::string> events = messages_in(events_file_of(run));
  for (std::string& event : events) event = without_time(event);
  return events;
}

/// How many events have a tag.
inline std::size_t count_tagged(const std::vector<std::string>& events, const std::string& tag) {
  const std::string field = std::string("\x0a") + static_cast<char>(tag.size()) + tag;
  std::size_t count = 0;
  for (const std::string& event : events) count += event.find(field) != std::string::npos ? 1 : 0;
  return count;
}

}  // namespace hsi4d::test

#include "core/log.h"

#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "tests/support/temporary_folder.h"

namespace log_test {

using namespace hsi4d;
using hsi4d::test::file_text;
using hsi4d::test::TemporaryFolder;

TEST_CASE("without a sink nothing is logged") {
  CHECK_FALSE(is_logged(LogLevel::kError));
  CHECK_NOTHROW(log_error("to nobody"));
}

TEST_CASE("a function receives what is at or above its level, as long as the sink lives") {
  std::vector<std::string> seen;
  {
    const LogSink sink = log_to(
        [&](LogLevel level, std::string_view message) {
          seen.push_back(std::string(log_level_name(level)) + " " + std::string(message));
        },
        LogLevel::kInfo);
    CHECK(is_logged(LogLevel::kInfo));
    CHECK_FALSE(is_logged(LogLevel::kDebug));
    log_debug("too fine");
    log_info("braces {} stay");
    log_warning("careful");
  }
  log_error("too late");
  CHECK(seen == std::vector<std::string>{"info braces {} stay", "warning careful"});
  CHECK_FALSE(is_logged(LogLevel::kError));
}

TEST_CASE("a file receives lines with time and level, each at once") {
  const TemporaryFolder folder;
  LogSink sink = log_to_file("log.txt", LogLevel::kDebug);
  log_debug("one");
  LogSink moved = std::move(sink);
  log_error("two");
  const std::string text = file_text("log.txt");
  CHECK_THAT(text,
             Catch::Matchers::Matches(
                 "\\d{4}-\\d\\d-\\d\\dT\\d\\d:\\d\\d:\\d\\d\\.\\d{3}[+-]\\d\\d:\\d\\d debug one\n.* error two\n"));
}

TEST_CASE("a message to one sink reaches no other") {
  const TemporaryFolder folder;
  int seen = 0;
  const LogSink other = log_to([&](LogLevel, std::string_view) { ++seen; }, LogLevel::kTrace);
  const LogSink file = log_to_file("log.txt", LogLevel::kInfo);
  file.write(LogLevel::kInfo, "for the {} file");
  file.write(LogLevel::kDebug, "too fine");
  log_warning("for both");
  CHECK(seen == 1);
  CHECK_THAT(file_text("log.txt"), Catch::Matchers::Matches("\\d{4}-\\d\\d-\\d\\dT\\d\\d:\\d\\d:\\d\\d\\.\\d{3}"
                                                            "[+-]\\d\\d:\\d\\d info for the \\{\\} file\n"
                                                            ".* warning for both\n"));
  const LogSink bad = log_to([](LogLevel, std::string_view) { throw std::runtime_error("full"); });
  const std::int64_t before = log_failures();
  CHECK_NOTHROW(bad.write(LogLevel::kInfo, "x"));
  CHECK(log_failures() == before + 1);
}

TEST_CASE("a log file that cannot be opened is the user's mistake") {
  const TemporaryFolder folder;
  folder.write("plain", "");
  CHECK_THROWS_MATCHES(log_to_file("plain/log.txt"), UserError,
                       Catch::Matchers::Message("plain/log.txt: the log file cannot be opened for writing"));
}

TEST_CASE("a sink that throws is counted and does not keep others from the message") {
  int seen = 0;
  const LogSink bad = log_to([](LogLevel, std::string_view) { throw std::runtime_error("full"); });
  const LogSink good = log_to([&](LogLevel, std::string_view) { ++seen; });
  const std::int64_t before = log_failures();
  CHECK_NOTHROW(log_info("x"));
  CHECK(seen == 1);
  CHECK(log_failures() == before + 1);
}

TEST_CASE("threads may log at the same time", "[parallel]") {
  std::vector<std::string> seen;
  {
    const LogSink sink = log_to([&](LogLevel, std::string_view message) { seen.emplace_back(message); });
    std::vector<std::thread> threads;
    for (int t = 0; t < 4; ++t) {
      threads.emplace_back([t] {
        for (int i = 0; i < 250; ++i) log_info(std::to_string(t) + " " + std::to_string(i));
      });
    }
    for (std::thread& thread : threads) thread.join();
  }
  CHECK(seen.size() == 1000);
}

TEST_CASE("warnings go once to each sink as long as that is asked for") {
  std::vector<std::string> first, second;
  const LogSink one = log_to([&first](LogLevel, std::string_view message) { first.emplace_back(message); });
  {
    const WarningsOnce once;
    log_warning("a");
    log_warning("a");
    log_info("i");
    log_info("i");
    const LogSink two = log_to([&second](LogLevel, std::string_view message) { second.emplace_back(message); });
    log_warning("a");
    log_warning("b");
  }
  log_warning("a");
  CHECK(first == std::vector<std::string>{"a", "i", "i", "b", "a"});
  CHECK(second == std::vector<std::string>{"a", "b"});
}

}  // namespace log_test

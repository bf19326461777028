// The log: messages of the library go to sinks that the program installs. Without a sink nothing is written anywhere.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string_view>

namespace hsi4d {

enum class LogLevel { kTrace, kDebug, kInfo, kWarning, kError };

/// "trace", "debug", "info", "warning" or "error".
std::string_view log_level_name(LogLevel level);

/// A sink that is installed as long as this lives.
class LogSink {
 public:
  struct State;
  explicit LogSink(std::shared_ptr<State> state);
  ~LogSink();
  LogSink(LogSink&&) noexcept;
  LogSink& operator=(LogSink&&) noexcept;
  LogSink(const LogSink&) = delete;
  LogSink& operator=(const LogSink&) = delete;

  /// Sends a message to this sink alone, if it wants this level: what belongs into a file and would disturb on a
  /// terminal. Any thread; a sink that fails is counted by log_failures.
  void write(LogLevel level, std::string_view message) const;

 private:
  std::shared_ptr<State> state_;
};

/// Appends lines "2024-05-01T12:00:00.123+02:00 info message" to a file, each one written out at once.
/// Throws UserError when the file cannot be opened.
[[nodiscard]] LogSink log_to_file(const std::filesystem::path& file, LogLevel least = LogLevel::kInfo);

/// Hands every message to a function, one at a time, on the thread that logs. The function must not log or install
/// sinks.
[[nodiscard]] LogSink log_to(std::function<void(LogLevel, std::string_view)> function,
                             LogLevel least = LogLevel::kInfo);

/// True when some sink wants messages of this level: ask before making an expensive one.
bool is_logged(LogLevel level);

/// Sends a message to every sink that wants it. Any thread; never throws because of a sink.
void log_message(LogLevel level, std::string_view message);

inline void log_debug(std::string_view message) { log_message(LogLevel::kDebug, message); }
inline void log_info(std::string_view message) { log_message(LogLevel::kInfo, message); }
inline void log_warning(std::string_view message) { log_message(LogLevel::kWarning, message); }
inline void log_error(std::string_view message) { log_message(LogLevel::kError, message); }

/// While it lives, no sink gets the same warning twice: for work that looks at the same inputs several times. One at a
/// time.
class WarningsOnce {
 public:
  WarningsOnce();
  ~WarningsOnce();
  WarningsOnce(const WarningsOnce&) = delete;
  WarningsOnce& operator=(const WarningsOnce&) = delete;
};

/// How many messages sinks have failed to write (a full disk, a function that threw) since the program began.
std::int64_t log_failures();

}  // namespace hsi4d

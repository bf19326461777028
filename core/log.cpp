#include "core/log.h"

#include <algorithm>
#include <atomic>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <spdlog/logger.h>
#include <spdlog/sinks/base_sink.h>
#include <spdlog/sinks/basic_file_sink.h>

#include "core/check.h"

namespace hsi4d {
namespace {

// Levels are spdlog's own, by number and by name.
static_assert(static_cast<int>(LogLevel::kTrace) == spdlog::level::trace);
static_assert(static_cast<int>(LogLevel::kError) == spdlog::level::err);

spdlog::level::level_enum spdlog_level(LogLevel level) { return static_cast<spdlog::level::level_enum>(level); }

class FunctionSink : public spdlog::sinks::base_sink<std::mutex> {
 public:
  explicit FunctionSink(std::function<void(LogLevel, std::string_view)> function) : function_(std::move(function)) {}

 protected:
  void sink_it_(const spdlog::details::log_msg& message) override {
    function_(static_cast<LogLevel>(message.level), std::string_view(message.payload.data(), message.payload.size()));
  }
  void flush_() override {}

 private:
  std::function<void(LogLevel, std::string_view)> function_;
};

/// Hands messages to every sink; one that throws is counted and does not keep the others from theirs.
class Distributor : public spdlog::sinks::base_sink<std::mutex> {
 public:
  void add(const spdlog::sink_ptr& target) {
    const std::lock_guard lock(mutex_);
    sinks_.push_back(target);
  }
  void remove(const spdlog::sink_ptr& target) {
    const std::lock_guard lock(mutex_);
    sinks_.erase(std::remove(sinks_.begin(), sinks_.end(), target), sinks_.end());
    if (warned_) warned_->erase(target.get());
  }
  /// Whether a warning goes to each sink once.
  void set_warnings_once(bool once) {
    const std::lock_guard lock(mutex_);
    warned_.reset();
    if (once) warned_.emplace();
  }
  spdlog::level::level_enum least_level() {
    const std::lock_guard lock(mutex_);
    spdlog::level::level_enum least = spdlog::level::off;
    for (const spdlog::sink_ptr& target : sinks_) least = std::min(least, target->level());
    return least;
  }
  /// Hands a message to one sink, if it wants it; counts a failure.
  void hand(spdlog::sinks::sink& target, const spdlog::details::log_msg& message) {
    if (!target.should_log(message.level)) return;
    try {
      target.log(message);
      target.flush();
    } catch (...) {
      failures_.fetch_add(1);
    }
  }
  std::int64_t failures() const { return failures_.load(); }

 protected:
  void sink_it_(const spdlog::details::log_msg& message) override {
    for (const spdlog::sink_ptr& target : sinks_) {
      if (is_new(*target, message)) hand(*target, message);
    }
  }
  void flush_() override {}

 private:
  bool is_new(const spdlog::sinks::sink& target, const spdlog::details::log_msg& message) {
    if (!warned_ || message.level != spdlog::level::warn) return true;
    return (*warned_)[&target].emplace(message.payload.data(), message.payload.size()).second;
  }

  std::vector<spdlog::sink_ptr> sinks_;
  std::optional<std::map<const spdlog::sinks::sink*, std::set<std::string>>> warned_;  // what each was sent
  std::atomic<std::int64_t> failures_{0};
};

/// The one logger. It is never destroyed: messages may come from the destructors of other statics.
struct Log {
  std::shared_ptr<Distributor> sinks = std::make_shared<Distributor>();
  spdlog::logger logger{"hsi4d", sinks};

  Log() {
    logger.set_level(spdlog::level::off);
    logger.set_error_handler([](const std::string&) {});  // spdlog's own writes to stderr
  }

  void install(const spdlog::sink_ptr& target) {
    const std::lock_guard lock(mutex_);
    sinks->add(target);
    logger.set_level(sinks->least_level());
  }
  void remove(const spdlog::sink_ptr& target) {
    const std::lock_guard lock(mutex_);
    sinks->remove(target);
    logger.set_level(sinks->least_level());
  }

 private:
  std::mutex mutex_;  // the sinks and the level that follows from them change together
};

Log& the_log() {
  static Log* const log = new Log;
  return *log;
}

}  // namespace

struct LogSink::State {
  explicit State(spdlog::sink_ptr installed) : sink(std::move(installed)) { the_log().install(sink); }
  ~State() { the_log().remove(sink); }
  State(const State&) = delete;
  State& operator=(const State&) = delete;

  spdlog::sink_ptr sink;
};

LogSink::LogSink(std::shared_ptr<State> state) : state_(std::move(state)) {}
LogSink::~LogSink() = default;
LogSink::LogSink(LogSink&&) noexcept = default;
LogSink& LogSink::operator=(LogSink&&) noexcept = default;

void LogSink::write(LogLevel level, std::string_view message) const {
  const spdlog::details::log_msg entry("hsi4d", spdlog_level(level),
                                       spdlog::string_view_t(message.data(), message.size()));
  the_log().sinks->hand(*state_->sink, entry);
}

namespace {

LogSink install(spdlog::sink_ptr sink, LogLevel least) {
  sink->set_level(spdlog_level(least));
  return LogSink(std::make_shared<LogSink::State>(std::move(sink)));
}

}  // namespace

std::string_view log_level_name(LogLevel level) {
  const spdlog::string_view_t name = spdlog::level::to_string_view(spdlog_level(level));
  return {name.data(), name.size()};
}

LogSink log_to_file(const std::filesystem::path& file, LogLevel least) {
  try {
    auto sink = std::make_shared<spdlog::sinks::basic_file_sink_mt>(file.string());
    sink->set_pattern("%Y-%m-%dT%H:%M:%S.%e%z %l %v");
    return install(std::move(sink), least);
  } catch (const spdlog::spdlog_ex&) {
    throw UserError(file.generic_string() + ": the log file cannot be opened for writing");
  }
}

LogSink log_to(std::function<void(LogLevel, std::string_view)> function, LogLevel least) {
  return install(std::make_shared<FunctionSink>(std::move(function)), least);
}

bool is_logged(LogLevel level) { return the_log().logger.should_log(spdlog_level(level)); }

void log_message(LogLevel level, std::string_view message) {
  the_log().logger.log(spdlog_level(level), spdlog::string_view_t(message.data(), message.size()));
}

WarningsOnce::WarningsOnce() { the_log().sinks->set_warnings_once(true); }
WarningsOnce::~WarningsOnce() { the_log().sinks->set_warnings_once(false); }

std::int64_t log_failures() { return the_log().sinks->failures(); }

}  // namespace hsi4d

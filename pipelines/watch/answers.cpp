#include "pipelines/watch/answers.h"

#include <algorithm>
#include <charconv>
#include <exception>
#include <optional>

#include "core/check.h"
#include "pipelines/report/assets.h"
#include "pipelines/watch/assets.h"
#include "pipelines/watch/watched.h"

namespace hsi4d {
namespace {

constexpr const char* kJson = "application/json";

ServedReply refusal(int status, const std::string& why) { return {status, "text/plain; charset=utf-8", why + "\n"}; }

/// "localhost" and "127.0.0.1", with any port: a tunnel may lead from another one.
bool is_own_host(const std::string& host) {
  const std::size_t colon = host.find(':');
  const std::string name = host.substr(0, colon), port = colon == std::string::npos ? "" : host.substr(colon + 1);
  const bool is_port = std::all_of(port.begin(), port.end(), [](char c) { return c >= '0' && c <= '9'; });
  return (name == "localhost" || name == "127.0.0.1") && is_port;
}

template <class Number>
std::optional<Number> number_in_request(const ServedRequest& request, const std::string& key) {
  const std::string text = request.parameter(key);
  Number number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end != text.data() + text.size() || number < 0) return std::nullopt;
  return number;
}

ServedReply image_answer(const WatchedRun& run, const ServedRequest& request) {
  const auto frame = number_in_request<int>(request, "frame");
  const std::string kind = request.parameter("kind");
  if (!frame || (kind != "target" && kind != "render")) return refusal(400, "frame or kind is wrong");
  try {
    const Bytes png = watched_image(run, *frame, kind);
    return {200, "image/png", std::string(png.begin(), png.end())};
  } catch (const UserError&) {
    return refusal(404, "there is no such image");
  }
}

ServedReply run_answer(const WatchedRun& run, const ServedRequest& request) {
  if (request.path == "/run") return {200, kJson, watched_run_json(run)};
  if (request.path == "/image") return image_answer(run, request);
  const auto from = number_in_request<std::int64_t>(request, "from");
  if (!from) return refusal(400, "from is wrong");
  return {200, kJson, watched_metrics_json(run, {request.parameter("file"), *from})};
}

ServedReply answer_of(const std::string& path, const ServedRequest& request) {
  if (request.path == "/") return {200, "text/html; charset=utf-8", std::string(watch_page())};
  if (request.path == "/watch.css") return {200, "text/css", std::string(report_style()) + std::string(watch_style())};
  if (request.path == "/watch.js") return {200, "text/javascript", std::string(watch_script())};
  if (request.path == "/runs") return {200, kJson, watched_runs_json(path)};
  if (request.path != "/run" && request.path != "/metrics" && request.path != "/image")
    return refusal(404, "there is no such page");
  const std::string id = request.parameter("run");
  for (const WatchedRun& run : watched_runs(path)) {
    if (run.id == id) return run_answer(run, request);
  }
  return refusal(404, "there is no such run");
}

}  // namespace

ServedReply watch_answer(const std::string& path, const ServedRequest& request) {
  if (!is_own_host(request.host)) return refusal(403, "this server answers to localhost and 127.0.0.1 alone");
  if (request.method != "GET") return refusal(405, "this server answers GET alone");
  try {
    return answer_of(path, request);
  } catch (const std::exception& error) {
    return refusal(500, error.what());
  }
}

}  // namespace hsi4d

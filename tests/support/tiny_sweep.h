// A sweep of tiny runs on a generated dataset, each of about a second.
#pragma once

#include <string>
#include <vector>

#include "tests/support/tiny_run.h"

namespace hsi4d::test {

/// Writes base.json into the current folder: kTinyStages and a dataset to be generated for them.
inline void write_tiny_base(int frames = kTinyFrames) {
  nlohmann::ordered_json base = nlohmann::ordered_json::parse(kTinyStages);
  base["synthetic"] = {{"frames", frames},        {"size_px", kTinyPixels},  {"video", "png"},
                       {"scene_gaussians", 1500}, {"avatar_gaussians", 500}, {"object_gaussians", 150}};
  std::ofstream("base.json") << base.dump(2);
}

/// Writes a sweep's file over base.json.
inline std::string write_sweep(const nlohmann::ordered_json& more, const std::string& name = "sweep.json") {
  nlohmann::ordered_json sweep = {{"name", "tiny"}, {"base", "base.json"}};
  sweep.update(more);
  std::ofstream(name) << sweep.dump(2);
  return name;
}

/// What a run's attempts have noted: how often each event.
inline std::map<std::string, int> events_of(const std::filesystem::path& sweep, const std::string& id) {
  std::map<std::string, int> events;
  std::istringstream text(file_text(sweep / "attempts" / (id + ".jsonl")));
  for (std::string line; std::getline(text, line);) {
    const nlohmann::json attempt = nlohmann::json::parse(line, nullptr, false);
    if (attempt.is_object()) ++events[attempt.value("event", "")];
  }
  return events;
}

/// The ids of a sweep's runs, by index.
inline std::vector<std::string> ids_of(const std::filesystem::path& sweep) {
  std::vector<std::string> ids;
  const nlohmann::json plan = json_of(sweep / "sweep.json");
  for (const auto& run : plan["runs"]) ids.push_back(run["id"]);
  return ids;
}

/// How often a run's log says that it is done.
inline int times_done(const std::filesystem::path& run) {
  const std::string log = file_text(run / "log.txt");
  int times = 0;
  for (std::size_t at = log.find(" done: "); at != std::string::npos; at = log.find(" done: ", at + 1)) ++times;
  return times;
}

}  // namespace hsi4d::test

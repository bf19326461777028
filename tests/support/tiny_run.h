// A synthetic dataset and a config so small that a whole run takes about a second, and what runs leave.
#pragma once

#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "core/config_file.h"
#include "optim/loss_term.h"
#include "pipelines/input/clip.h"
#include "pipelines/run/run.h"
#include "pipelines/synthetic/dataset.h"
#include "tests/support/temporary_folder.h"

namespace hsi4d::test {

/// The stages of the shipped demo with few iterations and no fingers; without the video, whose programs take longest.
inline const char* const kTinyStages = R"({
  "name": "tiny",
  "log": {"preview": false},
  "camera": {"increment": "scene"},
  "render": {"blur": 0.13},
  "stages": {
    "camera": {
      "iterations": 8, "draw": "scene", "weight": "unoccluded",
      "optimize": {"camera": {"lr": 0.004, "lr_final_share": 0.1}},
      "losses": {"masked_l2": {}}
    },
    "interaction": {
      "iterations": 10,
      "optimize": {
        "transl": {"lr": 0.01, "lr_final_share": 0.05},
        "global_orient": {"lr": 0.01, "lr_final_share": 0.05},
        "body_pose": {"lr": 0.01, "lr_final_share": 0.05},
        "object_orient": {"lr": 0.01, "lr_final_share": 0.05},
        "object_transl": {"lr": 0.01, "lr_final_share": 0.05}
      },
      "losses": {"photometric": {"ssim_share": 0.1}, "center": {"weight": 0.001}, "depth": {"weight": 0.1}}
    }
  }
})";

inline constexpr int kPerFrame = 18;  // iterations of kTinyStages
inline constexpr int kTinyFrames = 4;
inline constexpr int kTinyPixels = 48;
inline const std::string kTinyObject = "watering_can";

/// The dataset, made when a test first asks for it and removed when the program ends. Its config.json has kTinyStages.
class TinyDataset {
 public:
  static const std::filesystem::path& folder() {
    static const TinyDataset dataset;
    return dataset.folder_;
  }
  static SyntheticSettings settings() {
    SyntheticSettings settings;
    settings.frames = kTinyFrames;
    settings.size_px = kTinyPixels;
    settings.video = SyntheticVideo::kPng;  // no ffmpeg: fast, and frames that tests can change
    settings.scene_gaussians = 1500;
    settings.avatar_gaussians = 500;
    settings.object_gaussians = 150;
    return settings;
  }

 private:
  TinyDataset() {
    std::string pattern = (std::filesystem::temp_directory_path() / "hsi4d_tiny_XXXXXX").string();
    if (mkdtemp(pattern.data()) == nullptr) throw std::runtime_error("no temporary folder can be made");
    base_ = pattern;
    folder_ = base_ / "data";
    ConfigProblems problems;
    const ConfigValue stages = load_config_text(kTinyStages, "tiny.json", base_, {}, problems);
    problems.throw_if_any();
    write_dataset(settings(), video_render_settings(), folder_, {}, stages);
  }
  ~TinyDataset() {
    std::error_code error;
    std::filesystem::remove_all(base_, error);
  }

  std::filesystem::path base_, folder_;
};

inline std::string tiny_config_file() { return (TinyDataset::folder() / "config.json").string(); }

/// The config of the dataset, with overrides as `--set` takes them.
inline RunConfig tiny_config(const std::vector<std::string>& overrides = {}) {
  return load_run_config(tiny_config_file(), overrides, descriptions_of(loss_terms()));
}

/// The config of another dataset, likewise.
inline RunConfig config_in(const std::filesystem::path& dataset, const std::vector<std::string>& overrides) {
  return load_run_config(dataset / "config.json", overrides, descriptions_of(loss_terms()));
}

/// A run in this process.
inline RunSummary execute_tiny(const RunConfig& config, const std::string& folder, int threads = 1, bool resume = false,
                               std::function<bool()> stop_requested = {}) {
  RunOptions options;
  options.folder = folder;
  options.resume = resume;
  options.threads = threads;
  options.observer.stop_requested = std::move(stop_requested);
  return execute_run(config, loss_terms(), options);
}

inline nlohmann::json json_of(const std::filesystem::path& file) { return nlohmann::json::parse(file_text(file)); }

/// Writes a JSON file with the content of another one, or the same, changed.
template <class F>
void write_changed(const std::filesystem::path& from, const std::filesystem::path& to, F&& change) {
  nlohmann::ordered_json content = nlohmann::ordered_json::parse(file_text(from));
  change(content);
  std::ofstream(to) << content.dump(2);
}

/// The run's state is "failed", with this message.
inline void check_has_failed(const std::filesystem::path& run, const std::string& message) {
  const nlohmann::json status = json_of(run / "status.json");
  CHECK(status["state"] == "failed");
  CHECK(status["message"] == message);
}

/// The complete lines of a metrics.jsonl.
inline std::vector<nlohmann::json> metrics_of(const std::filesystem::path& run) {
  std::vector<nlohmann::json> lines;
  std::istringstream text(file_text(run / "metrics.jsonl"));
  for (std::string line; std::getline(text, line);) lines.push_back(nlohmann::json::parse(line));
  return lines;
}

/// Drops every "seconds", which no two runs have in common.
inline nlohmann::json without_seconds(nlohmann::json value) {
  if (value.is_object()) value.erase("seconds");
  for (auto& item : value) {
    if (item.is_structured()) item = without_seconds(item);
  }
  return value;
}

/// Everything that must be the same however a run came about, by name: files as bytes, the lines of metrics.jsonl and
/// the members of summary.json without seconds.
inline std::map<std::string, std::string> result_of(const std::filesystem::path& run) {
  std::map<std::string, std::string> result;
  for (const char* name : {"config.resolved.json", "motion.npz", "motion_30fps.npz", "objects.npz", "cameras.json",
                           "view3d.safetensors"}) {
    result[name] = file_text(run / name);
  }
  for (const char* name : {"body.glb", "preview.mp4", "color_net.safetensors"}) {  // not every run has these
    if (std::filesystem::exists(run / name)) result[name] = file_text(run / name);
  }
  for (const auto& entry : std::filesystem::directory_iterator(run / "frames")) {
    result["frames/" + entry.path().filename().string()] = file_text(entry.path());
  }
  const std::vector<nlohmann::json> lines = metrics_of(run);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    result["metrics.jsonl:" + std::to_string(i + 1)] = without_seconds(lines[i]).dump();
  }
  // As text, in the order in which the file has its members.
  result["summary.json"] = without_seconds(nlohmann::ordered_json::parse(file_text(run / "summary.json"))).dump();
  return result;
}

/// The names of what differs in two runs; empty when nothing does.
inline std::vector<std::string> differences(const std::filesystem::path& a, const std::filesystem::path& b) {
  const auto x = result_of(a), y = result_of(b);
  std::vector<std::string> names;
  for (const auto& [name, content] : x) {
    const auto other = y.find(name);
    if (other == y.end()) names.push_back(name + " (only in " + a.string() + ")");
    if (other != y.end() && other->second != content) {
      const bool is_text = name.starts_with("metrics") || name.starts_with("summary");
      names.push_back(is_text ? name + ": " + content + " against " + other->second : name);
    }
  }
  for (const auto& [name, content] : y) {
    if (!x.contains(name)) names.push_back(name + " (only in " + b.string() + ")");
  }
  return names;
}

/// Files of a folder, also of folders in it, that a writer left half done.
inline std::vector<std::string> temporaries_in(const std::filesystem::path& folder) {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (entry.path().extension() == ".tmp") names.push_back(entry.path().string());
  }
  return names;
}

/// The number of that name, which must be there.
inline double number_in(const MetricValues& values, const std::string& name) {
  const double* value = find_metric(values, name);
  INFO("metric " << name);
  REQUIRE(value != nullptr);
  return *value;
}

/// A figure after a run's last stage.
inline double last_number(const RunSummary& summary, const std::string& name) {
  return number_in(summary.metrics.back().values, name);
}

/// A copy of the dataset, to be changed.
struct CopiedDataset {
  TemporaryFolder folder;
  std::filesystem::path path = folder.path() / "data";

  CopiedDataset() { std::filesystem::copy(TinyDataset::folder(), path, std::filesystem::copy_options::recursive); }
  Clip read() const { return read_clip(dataset_inputs(path)); }
};

}  // namespace hsi4d::test

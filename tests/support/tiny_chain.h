// A chain of two clips so small that a whole run of it takes a few seconds.
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "pipelines/chain/chain.h"
#include "tests/support/tiny_run.h"

namespace hsi4d::test {

inline constexpr int kClips = 2, kClipFrames = 3;

/// Two clips of three frames with a camera each, made when a test first asks for it; removed when the program ends.
class TinyChain {
 public:
  static const std::filesystem::path& folder() {
    static const TinyChain chain;
    return chain.folder_;
  }

 private:
  TinyChain() {
    std::string pattern = (std::filesystem::temp_directory_path() / "hsi4d_chain_XXXXXX").string();
    if (mkdtemp(pattern.data()) == nullptr) throw std::runtime_error("no temporary folder can be made");
    base_ = pattern;
    folder_ = base_ / "data";
    SyntheticSettings settings = TinyDataset::settings();
    settings.frames = kClipFrames;
    settings.clips = kClips;
    ConfigProblems problems;
    const ConfigValue stages = load_config_text(kTinyStages, "tiny.json", base_, {}, problems);
    write_dataset(settings, video_render_settings(), folder_, {}, stages);
  }
  ~TinyChain() {
    std::error_code error;
    std::filesystem::remove_all(base_, error);
  }

  std::filesystem::path base_, folder_;
};

inline std::string chain_file() { return (TinyChain::folder() / "config.json").string(); }

inline RunConfig chain_config(const std::vector<std::string>& overrides = {}) {
  return load_run_config(chain_file(), overrides, descriptions_of(loss_terms()), ConfigUse::kRun);
}

inline ChainSummary execute_tiny_chain(const RunConfig& config, const std::string& folder, int threads = 1,
                                       bool resume = false, std::function<bool()> stop_requested = {}) {
  RunOptions options;
  options.folder = folder;
  options.resume = resume;
  options.threads = threads;
  options.observer.stop_requested = std::move(stop_requested);
  return execute_chain(config, loss_terms(), options);
}

/// A config beside the dataset's own, changed.
template <class F>
RunConfig changed_config(F&& change) {
  const std::filesystem::path file = TinyChain::folder() / "changed.json";
  write_changed(chain_file(), file, change);
  return load_run_config(file, {}, descriptions_of(loss_terms()), ConfigUse::kRun);
}

/// What must be the same of the folder of a chain, however it came about.
inline std::map<std::string, std::string> result_of_chain(const std::filesystem::path& chain) {
  std::map<std::string, std::string> result;
  for (const char* name :
       {"config.resolved.json", "motion.npz", "motion_30fps.npz", "objects.npz", "cameras.json", "body.glb"})
    result[name] = file_text(chain / name);
  if (std::filesystem::exists(chain / "preview.mp4")) result["preview.mp4"] = file_text(chain / "preview.mp4");
  result["summary.json"] = without_seconds(nlohmann::ordered_json::parse(file_text(chain / "summary.json"))).dump();
  return result;
}

inline void check_same_chains(const std::filesystem::path& a, const std::filesystem::path& b) {
  CHECK(result_of_chain(a) == result_of_chain(b));
  const std::vector<std::string> none;
  for (const char* clip : {"clip1", "clip2"}) CHECK(differences(a / "clips" / clip, b / "clips" / clip) == none);
}

}  // namespace hsi4d::test

#include "pipelines/evaluate/prompt.h"

#include "core/file.h"
#include "core/json_text.h"
#include "pipelines/evaluate/tracks.h"
#include "pipelines/record/folder.h"

namespace hsi4d {

std::string run_prompt(const std::filesystem::path& run) {
  const std::string file = RunPaths{run}.config();
  if (!is_run_folder(run.string()) || !std::filesystem::exists(file)) return "";
  const ConfigValue tree = parse_json_text(read_text_file(file), file);
  for (const char* const name : {"sources", "instance"}) {
    const ConfigValue* const section = find_member(tree, name);
    const std::string prompt = section == nullptr ? "" : string_member(*section, "prompt");
    if (!prompt.empty()) return prompt;
  }
  return "";
}

}  // namespace hsi4d

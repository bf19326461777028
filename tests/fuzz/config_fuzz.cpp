// Any bytes as a config: the reader answers with a config or with a UserError, and what it accepts it writes and reads
// back to the same text. The first byte decides how much of the input is an override.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <vector>

#include "core/check.h"
#include "core/config_file.h"
#include "pipelines/run_config.h"
#include "tests/support/test_losses.h"

namespace {

std::string resolved(const std::string& text, const std::vector<std::string>& overrides) {
  const std::vector<hsi4d::LossDescription> losses = hsi4d::test::test_losses();
  hsi4d::ConfigProblems problems;
  const hsi4d::ConfigValue tree = hsi4d::load_config_text(text, "fuzz.json", "/nonexistent", overrides, problems);
  return hsi4d::resolved_config(hsi4d::read_run_config(tree, losses, problems), losses);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string bytes(reinterpret_cast<const char*>(data), size);
  const std::size_t cut = size == 0 ? 0 : 1 + data[0] % 64U;
  std::vector<std::string> overrides;
  if (size > 0 && data[0] >= 128 && cut <= size) overrides.push_back(bytes.substr(1, cut - 1));
  const std::string text = overrides.empty() ? bytes : bytes.substr(cut);
  try {
    const std::string once = resolved(text, overrides);
    if (resolved(once, {}) != once) std::abort();
  } catch (const hsi4d::UserError&) {
    return 0;
  }
  return 0;
}

#include "stress/poison.h"

#include <filesystem>
#include <regex>
#include <string>

#include <catch2/catch.hpp>

#include "core/file.h"

namespace poison_test {

using namespace hsi4d;

namespace {

namespace fs = std::filesystem;

/// kName of every operator that the sources define.
stress::OperatorNames operators_of_sources() {
  stress::OperatorNames names;
  const std::regex name("kName = \"([a-z0-9_]+)\"");
  for (const char* layer : {"core", "autodiff", "splat", "body", "optim", "pipelines"}) {
    for (const fs::directory_entry& entry : fs::recursive_directory_iterator(fs::path(HSI4D_SOURCE_DIR) / layer)) {
      const fs::path& path = entry.path();
      if ((path.extension() != ".h" && path.extension() != ".cpp")) continue;
      const std::string text = read_text_file(path);
      for (std::sregex_iterator at(text.begin(), text.end(), name), end; at != end; ++at) names.insert((*at)[1]);
    }
  }
  return names;
}

}  // namespace

TEST_CASE("every operator of the sources is poisoned in every input") {
  const stress::OperatorNames defined = operators_of_sources(), poisoned = stress::poisoned_operators();
  REQUIRE(defined.size() > 60);
  REQUIRE(defined.contains("composite"));
  for (const std::string& name : defined) {
    INFO("operator " << name << ": stress/poison_*.cpp");
    CHECK(poisoned.contains(name));
  }
  for (const std::string& name : poisoned) {
    INFO("operator " << name << " is no kName of the sources");
    CHECK(defined.contains(name));
  }
}

TEST_CASE("an operator counts as poisoned only when each of its inputs is") {
  Tape<double> tape;
  const auto leaf = [&tape](const char* name) { return tape.parameter(name, shape_of(2, 3)); };
  const auto a = leaf("a"), b = leaf("b"), c = leaf("c");
  const stress::Vars<double> outputs = {exp(a) + b, sin(c)};
  stress::OperatorNames names;
  stress::add_poisoned_operators<double>(tape, {a}, outputs, names);
  CHECK(names == stress::OperatorNames{"exp"});
  stress::add_poisoned_operators<double>(tape, {a, b}, outputs, names);
  CHECK(names == stress::OperatorNames{"add", "exp"});
}

}  // namespace poison_test

#include "pipelines/cli/bench_command.h"

#include <sstream>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "core/check.h"
#include "core/file.h"
#include "tests/temporary_folder.h"

using namespace hsi4d;

TEST_CASE("bench rasterize measures every step and writes one object a measurement") {
  const TemporaryFolder folder;
  cli::BenchOptions options;
  options.workloads = {"small"};
  options.repeats = 1;
  options.json = folder / "m.json";
  const std::string table = cli::bench_rasterize_command(options);
  std::istringstream lines(read_text_file(options.json));
  std::vector<std::string> names;
  for (std::string line; std::getline(lines, line);) {
    const auto m = nlohmann::json::parse(line);
    names.push_back(m.at("name"));
    CHECK(table.find(names.back()) != std::string::npos);
    CHECK(m.at("gaussians") == 100000);
    CHECK(m.at("pixels") == 512 * 512);
    CHECK(m.at("fragments") > m.at("groups"));
    CHECK(m.at("groups") > m.at("pairs"));
    CHECK(m.at("pairs") > m.at("gaussians"));
    CHECK(m.at("median_ms") >= m.at("min_ms"));
    const double rate = m.at("fragments").get<double>() / m.at("median_ms").get<double>() / 1e3;
    CHECK(m.at("mfragments_per_s").get<double>() == Approx(rate));
  }
  CHECK(names == std::vector<std::string>{"rasterize/small/records", "rasterize/small/sort", "rasterize/small/bin",
                                          "rasterize/small/forward", "rasterize/small/backward",
                                          "rasterize/small/reduce", "rasterize/small/backward_with_colors",
                                          "rasterize/small/reduce_with_colors"});
}

TEST_CASE("bench tells which workloads there are") {
  cli::BenchOptions options;
  options.workloads = {"smal"};
  CHECK_THROWS_WITH(
      cli::bench_rasterize_command(options),
      "hsi4d bench rasterize: no workload \"smal\"; known: avatar, scene, avatar_in_scene, small; did you "
      "mean \"small\"?");
}

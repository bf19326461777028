#include "bench/command.h"

#include <map>
#include <sstream>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "bench/list.h"
#include "bench/pixel_filter_table.h"
#include "core/check.h"
#include "core/file.h"
#include "core/simd.h"
#include "stress/scratch_folder.h"
#include "tests/bench/rows.h"

namespace command_test {

using namespace hsi4d;

TEST_CASE("bench rasterize measures every step and writes one object a measurement") {
  const ScratchFolder folder;
  cli::BenchOptions options;
  options.workloads = {"small"};
  options.repeats = 1;
  options.json = folder / "m.json";
  const std::string table = cli::run_kernels({cli::rasterize_topic()}, options);
  std::istringstream lines(read_text_file(options.json));
  std::vector<std::string> names;
  std::vector<double> shares;
  for (std::string line; std::getline(lines, line);) {
    const auto m = nlohmann::json::parse(line);
    names.push_back(m.at("name"));
    CHECK(table.find(names.back()) != std::string::npos);
    CHECK(m.at("gaussians") == 100000);
    CHECK(m.at("pixels") == 512 * 512);
    CHECK(m.at("fragments") > m.at("groups"));
    CHECK(m.at("groups") > m.at("pairs"));
    CHECK(m.at("pairs") > m.at("gaussians"));
    test::check_bench_row(m);
    const std::string step = names.back().substr(std::string("rasterize/small/").size());
    const bool composites = step.starts_with("forward") || step.starts_with("backward");
    CHECK(m.contains("mfragments_per_s") == composites);
    CHECK(m.at("unit") == (composites ? "fragments" : step == "bin" ? "pairs" : "gaussians"));
    const double rate = m.at(m.at("unit").get<std::string>()).get<double>() / m.at("median_ms").get<double>() / 1e3;
    CHECK(m.at("millions_per_s").get<double>() == Approx(rate));
    CHECK(m.contains("mfragments_per_s") == composites);
    if (composites) CHECK(m.at("mfragments_per_s") == m.at("millions_per_s"));
    CHECK(m.at("peak_memory_bytes") > m.at("pixels").get<double>() * 4 * 4);
    CHECK(m.contains("fma_peak_share") == (composites && m.contains("fma_peak_per_s")));
    if (!m.contains("fma_peak_share")) continue;
    const double operations = 16 * m.at("groups").get<double>() *
                              (step == "forward"    ? 20
                               : step == "backward" ? 38
                                                    : 44);
    const double share = operations / (1e-3 * m.at("min_ms").get<double>()) / m.at("fma_peak_per_s").get<double>();
    CHECK(m.at("fma_peak_share").get<double>() == Approx(share));
    CHECK(share > 0);  // the peak is timed apart: on a busy machine a share can pass one
    shares.push_back(share);
  }
  CHECK(shares.size() == (best_isa() == Isa::kBaseline ? 0 : 3));
  CHECK((table.find(" peak %") != std::string::npos && table.find("G multiply-adds a second") != std::string::npos) ==
        !shares.empty());
  CHECK(names == std::vector<std::string>{"rasterize/small/records", "rasterize/small/sort", "rasterize/small/bin",
                                          "rasterize/small/forward", "rasterize/small/backward",
                                          "rasterize/small/reduce", "rasterize/small/backward_with_colors",
                                          "rasterize/small/reduce_with_colors"});
}

TEST_CASE("bench tells which workloads there are") {
  cli::BenchOptions options;
  options.workloads = {"smal"};
  CHECK_THROWS_WITH(
      cli::run_kernels({cli::rasterize_topic()}, options),
      "hsi4d bench rasterize: no workload \"smal\"; known: avatar, scene, avatar_in_scene, small; did you "
      "mean \"small\"?");
}

TEST_CASE("bench skinning measures a body and writes one object a measurement") {
  const ScratchFolder folder;
  cli::BenchOptions options;
  options.workloads = {"fixed_hands", "no_correctives"};
  options.repeats = 2;
  options.json = folder / "m.json";
  const std::string table = cli::run_kernels({cli::skinning_topic()}, options);
  std::istringstream lines(read_text_file(options.json));
  std::vector<std::string> names;
  for (std::string line; std::getline(lines, line);) {
    const auto m = nlohmann::json::parse(line);
    names.push_back(m.at("name"));
    CHECK(table.find(names.back()) != std::string::npos);
    CHECK(m.at("vertices") == 10475);
    CHECK(m.at("joints") == 55);
    CHECK(m.at("repeats") == 2);
    test::check_bench_row(m);
    const bool has_correctives = names.back().find("fixed_hands") != std::string::npos;
    CHECK(m.at("corrective_columns") == (has_correctives ? 24 * 9 : 0));
    CHECK((m.at("table_bytes") > 0) == has_correctives);
    CHECK(m.at("packing_error_m").get<double>() <= 5e-6);
    const double reads = names.back().ends_with("/both") ? 2 : 1;
    const double rate = reads * m.at("table_bytes").get<double>() / m.at("median_ms").get<double>() / 1e6;
    CHECK(m.at("gbytes_per_s").get<double>() == Approx(rate));
  }
  CHECK(names == std::vector<std::string>{"skinning/fixed_hands/forward", "skinning/fixed_hands/backward",
                                          "skinning/fixed_hands/both", "skinning/no_correctives/forward",
                                          "skinning/no_correctives/backward", "skinning/no_correctives/both"});
  options.workloads = {"posing"};
  CHECK(cli::run_kernels({cli::skinning_topic()}, options).find("skinning/posing/both") != std::string::npos);
  const auto posing =
      nlohmann::json::parse(read_text_file(options.json).substr(0, read_text_file(options.json).find('\n')));
  CHECK(posing.at("name") == "skinning/posing/forward");
  CHECK(posing.at("gaussians") == 50000);
  CHECK_FALSE(posing.contains("vertices"));
  CHECK_FALSE(posing.contains("corrective_columns"));
  CHECK(posing.at("min_ms") > 0);
  options.workloads = {"fixed_hand"};
  CHECK_THROWS_WITH(cli::run_kernels({cli::skinning_topic()}, options),
                    "hsi4d bench skinning: no workload \"fixed_hand\"; known: smplx, smplx_floats, fixed_hands, "
                    "fixed_hands_floats, no_correctives, posing; did you mean \"fixed_hands\"?");
}

TEST_CASE("bench color_net measures forward and backward and writes one object a measurement") {
  const ScratchFolder folder;
  cli::BenchOptions options;
  options.workloads = {"narrow", "view_direction"};
  options.repeats = 2;
  options.json = folder / "m.json";
  const std::string table = cli::run_kernels({cli::color_net_topic()}, options);
  std::istringstream lines(read_text_file(options.json));
  std::vector<std::string> names;
  for (std::string line; std::getline(lines, line);) {
    const auto m = nlohmann::json::parse(line);
    names.push_back(m.at("name"));
    INFO(names.back());
    CHECK(table.find(names.back()) != std::string::npos);
    CHECK(m.at("gaussians") == 50000);
    CHECK(m.at("features") == 16);
    CHECK(m.at("repeats") == 2);
    test::check_bench_row(m);
    const bool narrow = names.back().find("narrow") != std::string::npos;
    const double width = m.at("hidden_width"), inputs = narrow ? 16 : 19;
    CHECK(width == (narrow ? 16 : 32));
    const double once = 50000 * (inputs * width + width * width + 3 * width);
    const double pose = 3 * once - 50000 * width * 16;  // nothing goes back to the features
    const double expected = names.back().ends_with("forward") ? once : names.back().ends_with("both") ? 4 * once : pose;
    CHECK(m.at("multiply_adds").get<double>() == expected);
    if (!m.contains("fma_peak_share")) continue;
    const double rate = expected / (1e-3 * m.at("min_ms").get<double>());
    CHECK(m.at("fma_peak_share").get<double>() == Approx(rate / m.at("fma_peak_per_s").get<double>()));
  }
  CHECK(names == std::vector<std::string>{"color_net/view_direction/forward", "color_net/view_direction/both",
                                          "color_net/view_direction/pose", "color_net/narrow/forward",
                                          "color_net/narrow/both", "color_net/narrow/pose"});
  options.workloads = {"wid"};
  CHECK_THROWS_WITH(
      cli::run_kernels({cli::color_net_topic()}, options),
      "hsi4d bench color_net: no workload \"wid\"; known: default, view_direction, narrow, wide, deep; did "
      "you mean \"wide\"?");
}

TEST_CASE("bench tape measures nodes and lambda losses and writes one object a measurement") {
  const ScratchFolder folder;
  cli::BenchOptions options;
  options.repeats = 3;
  options.json = folder / "m.json";
  const std::string table = cli::run_kernels({cli::tape_topic()}, options);
  std::istringstream lines(read_text_file(options.json));
  std::map<std::string, nlohmann::json> found;
  for (std::string line; std::getline(lines, line);) {
    const auto m = nlohmann::json::parse(line);
    const std::string name = m.at("name");
    INFO(line);
    CHECK(table.find(name) != std::string::npos);
    CHECK(m.at("threads") == 1);
    CHECK(m.at("repeats") == 3);
    CHECK(m.at("min_ms") > 0);
    CHECK(m.at("median_ms") >= m.at("min_ms"));
    const bool is_chain = m.contains("nodes");
    const double count = m.at(is_chain ? "nodes" : "elements"),
                 each = m.at(is_chain ? "ns_per_node" : "ns_per_element");
    if (is_chain || name.starts_with("tape/loss_")) CHECK(count == (is_chain ? 1000 : 2048));
    CHECK(each == Approx(1e6 * m.at("median_ms").get<double>() / count));
    found[name] = m;
  }
  CHECK(found.size() == 11);
  CHECK(found.at("tape/ssim/both").at("elements") == 1024 * 1024);
  CHECK(found.at("tape/skinning/gradient").at("against") == "tape/skinning/primal");
  CHECK(found.at("tape/anomaly/on").at("goal") == 1.3);
  CHECK(found.at("tape/nodes/both").at("goal") == 100);
  CHECK_FALSE(found.at("tape/additions/both").contains("goal"));
  for (const auto& [loss, goal] : std::map<std::string, int>{{"tape/loss_of_4/", 2}, {"tape/loss_of_10/", 3}}) {
    const nlohmann::json &gradient = found.at(loss + "gradient"), &primal = found.at(loss + "primal");
    CHECK(gradient.at("goal") == goal);
    CHECK(gradient.at("against") == loss + "primal");
    CHECK(gradient.at("ratio").get<double>() ==
          Approx(gradient.at("median_ms").get<double>() / primal.at("median_ms").get<double>()));
    CHECK_FALSE(primal.contains("ratio"));
  }
  options.workloads = {"loss_of_10"};
  CHECK(cli::run_kernels({cli::tape_topic()}, options).find("tape/loss_of_4") == std::string::npos);
  options.workloads = {"loss_of_5"};
  CHECK_THROWS_WITH(
      cli::run_kernels({cli::tape_topic()}, options),
      "hsi4d bench tape: no workload \"loss_of_5\"; known: nodes, additions, loss_of_4, loss_of_10, ssim, skinning, "
      "anomaly; did "
      "you mean \"loss_of_4\"?");
}

TEST_CASE("bench without a topic measures the kernels", "[full]") {
  const ScratchFolder folder;
  cli::BenchOptions options;
  options.repeats = 1;
  options.json = folder / "m.json";
  const std::string table = cli::bench_kernels_command(options), json = read_text_file(options.json);
  for (const char* name :
       {"rasterize/small/forward", "skinning/smplx/both", "color_net/default/both", "tape/nodes/both"}) {
    CHECK(table.find(name) != std::string::npos);
    CHECK(json.find("{\"name\":\"" + std::string(name) + "\"") != std::string::npos);
  }
}

TEST_CASE("bench pixel_filter judges every filter at a height and writes one object a measurement", "[full]") {
  const ScratchFolder folder;
  PixelFilterBench options;
  options.figures = {"avatar_5000"};
  options.heights_px = {16};
  options.json = folder / "m.json";
  const std::string table = bench_pixel_filter(options);
  std::istringstream lines(read_text_file(options.json));
  std::map<std::string, nlohmann::json> found;
  for (std::string line; std::getline(lines, line);) {
    const auto m = nlohmann::json::parse(line);
    const std::string name = m.at("name"), prefix = "pixel_filter/avatar_5000/16/";
    CHECK(table.find(name) != std::string::npos);
    REQUIRE(name.substr(0, prefix.size()) == prefix);
    CHECK(m.at("gaussians") == 5000);
    CHECK(m.at("height_px") == 16);
    CHECK(m.at("sigma_px").get<double>() == Approx(0.115).epsilon(0.1));
    found[name.substr(prefix.size())] = m;
  }
  CHECK(found.size() == 8 * 3 + 2);
  const auto number = [&](const char* name, const char* key) { return found.at(name).at(key).get<double>(); };
  for (const std::string truth : {"box", "soft", "clip"}) {
    CHECK(number((truth + "/plain").c_str(), "blur") == 0.3);
    CHECK(number((truth + "/antialias_box").c_str(), "blur") == Approx(1.0 / 12));
    CHECK(number((truth + "/plain_matched").c_str(), "rms") <= number((truth + "/plain").c_str(), "rms"));
    CHECK(number((truth + "/antialias_matched").c_str(), "rms") <=
          1.001 * number((truth + "/antialias_box").c_str(), "rms"));
  }
  CHECK(number("box/antialias_within", "width_px") <= 0.05);
  CHECK(number("box/plain", "width_px") > number("box/antialias", "width_px"));
  CHECK(number("box/plain", "distance_error") > 0.05);
  CHECK(std::abs(number("box/truth_4x", "width_px")) < 0.05);
}

TEST_CASE("bench pixel_filter tells which figures and heights there are") {
  PixelFilterBench options;
  options.figures = {"avatar"};
  CHECK_THROWS_WITH(bench_pixel_filter(options),
                    "hsi4d bench pixel_filter: no workload \"avatar\"; known: avatar_5000, avatar_40000; did you mean "
                    "\"avatar_5000\"?");
  options.figures = {};
  options.heights_px = {4};
  CHECK_THROWS_WITH(bench_pixel_filter(options), "hsi4d bench pixel_filter: a height of 4 px; allowed: 8 to 2048");
}

}  // namespace command_test

// Studies made and answered by the program: what is shown of runs, what people get, and what is refused.
#include "pipelines/study/study.h"

#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <tuple>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "core/file.h"
#include "core/image_io.h"
#include "core/video.h"
#include "tests/support/made_sweep.h"
#include "tests/support/program.h"

namespace study_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
using Catch::Matchers::Matches;
using Catch::Matchers::StartsWith;
namespace fs = std::filesystem;
using Names = std::vector<std::string>;

namespace {

/// A picture whose columns [0, w), [w, 2w), ... have these greys.
Image bars(const std::vector<float>& greys, int width = 16, int height = 16) {
  Image image(3, height, width * static_cast<int>(greys.size()));
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < image.width(); ++x) image(c, y, x) = greys[static_cast<std::size_t>(x / width)];
    }
  }
  return image;
}

/// Each video is encoded once and copied from then on.
void write_video(const fs::path& file, const std::vector<float>& greys, int frames = 2, double rate = 10) {
  static std::map<std::tuple<std::vector<float>, int, double>, Bytes> encoded;
  Bytes& content = encoded[{greys, frames, rate}];
  if (content.empty()) {
    const Image image = bars(greys);
    VideoWriter video(file.string(), image.width(), image.height(), {.frame_rate = rate});
    for (int t = 0; t < frames; ++t) video.add(image);
    video.commit();
    content = read_file(file.string());
  } else {
    write_file(file.string(), content);
  }
}

/// A folder with a preview, as programs other than hsi4d leave one.
void foreign_run(const fs::path& folder, float grey, int frames = 2, double rate = 10) {
  fs::create_directories(folder);
  write_video(folder / "preview.mp4", {grey}, frames, rate);
}

/// A run folder as hsi4d run leaves one, as far as a study reads it.
void own_run(const fs::path& folder, float grey, const std::string& prompt) {
  fs::create_directories(folder);
  write_video(folder / "preview.mp4", {0, grey, 0.5F, 1});
  std::ofstream(folder / "status.json") << "{}";
  std::ofstream(folder / "config.resolved.json") << nlohmann::json({{"sources", {{"prompt", prompt}}}}).dump();
}

/// Two folders of two runs each, of which one has a text.
void two_methods() {
  own_run("a/walk", 0.2F, "A person walks.");
  own_run("b/walk", 0.8F, "A person walks.");
  own_run("a/deep/sit", 0.3F, "");
  own_run("b/deep/sit", 0.7F, "");
}

ProgramResult study(Names words) {
  words.insert(words.begin(), "study");
  words.push_back("--quiet");
  return run_hsi4d(words);
}

std::string refused(const Names& words) {
  const ProgramResult result = study(words);
  CHECK(result.status == 2);
  CHECK(result.out.empty());
  return result.err;
}

nlohmann::json json_in(const fs::path& file) { return nlohmann::json::parse(file_text(file)); }

float grey_of(const std::string& video) { return VideoReader(video).read(0)(0, 8, 8); }

/// The answers of a person who chose A (or B) everywhere, A being left.
nlohmann::json answers_of(const nlohmann::json& key, const std::string& person, bool prefers_a) {
  nlohmann::json answers = nlohmann::json::array();
  for (const nlohmann::json& pair : key["pairs"]) {
    nlohmann::json chosen = {{"quality", pair[prefers_a ? "a" : "b"]}};
    if (pair["text"] != "") chosen["text"] = pair["a"];
    answers.push_back({{"pair", pair["id"]},
                       {"left", pair["a"]},
                       {"right", pair["b"]},
                       {"chosen", chosen},
                       {"seconds", 7},
                       {"plays", 2}});
  }
  return {{"format", "hsi4d study answers"},
          {"version", 1},
          {"study", key["study"]},
          {"person", person},
          {"begun", "2026-01-01T10:00:00Z"},
          {"finished", "2026-01-01T10:05:00Z"},
          {"answers", answers}};
}

void write(const fs::path& file, const nlohmann::json& content) { std::ofstream(file) << content.dump(1); }

}  // namespace

TEST_CASE("a study has the reconstructions of runs by name, and tells nobody whose they are") {
  const TemporaryFolder here;
  two_methods();
  own_run("a/only", 0.1F, "");
  const ProgramResult made = study({"a", "b", "--out", "page/", "--seed", "0"});
  INFO(made.err);
  REQUIRE(made.status == 0);
  CHECK(made.out ==
        "page/index.html: 2 pairs, of which a person is shown 2; goes with videos/\n"
        "page-key.json: the key, which tells A from B: keep it, do not hand it out\n"
        "note: b lacks what a has, which is left out: only\n"
        "note: no text is known of deep/sit: agreement with it is not asked; sources.prompt of a run's config says it, "
        "or --texts\n");
  const nlohmann::json key = json_in("page-key.json");
  REQUIRE(key["pairs"].size() == 2);
  CHECK(key["pairs"][0]["name"] == "deep/sit");
  CHECK(key["pairs"][1]["text"] == "A person walks.");
  const auto video = [](const nlohmann::json& name) { return "page/videos/" + name.get<std::string>() + ".mp4"; };
  CHECK(grey_of(video(key["pairs"][0]["a"])) == Approx(0.3).margin(0.02));
  CHECK(grey_of(video(key["pairs"][0]["b"])) == Approx(0.7).margin(0.02));
  CHECK(grey_of(video(key["pairs"][1]["a"])) == Approx(0.2).margin(0.02));
  CHECK(VideoReader(video(key["pairs"][1]["b"])).read(1).width() == 16);
  std::size_t files = 0;
  for (const auto& entry : fs::recursive_directory_iterator("page")) files += entry.is_regular_file() ? 1 : 0;
  CHECK(files == 5);
  const std::string page = file_text("page/index.html");
  for (const char* word : {"deep", "sit", "preview", "a/walk", "b/walk"}) CHECK_THAT(page, !Contains(word));
  CHECK_THAT(page, Contains("A person walks.") && !Contains("http"));

  // The same again, and in one file; another seed gives other names.
  REQUIRE(study({"a", "b", "--out", "again", "--embed", "--seed", "0"}).status == 0);
  CHECK(file_text("again-key.json") == file_text("page-key.json"));
  CHECK_FALSE(fs::exists("again/videos"));
  REQUIRE(study({"a", "b", "--out", "other", "--seed", "1"}).status == 0);
  CHECK(json_in("other-key.json")["study"] != key["study"]);

  std::set<fs::file_time_type> times;  // which of two was made first is not told either
  for (const auto& entry : fs::directory_iterator("page/videos")) times.insert(fs::last_write_time(entry));
  CHECK(times.size() == 1);
}

TEST_CASE("a page knows where answers go and what its person gets, which changes neither study nor key") {
  const TemporaryFolder here;
  two_methods();
  const auto data_of = [](const std::string& folder) {
    const std::string page = file_text(fs::path(folder) / "index.html"), begin = "id=\"study-data\">";
    const std::size_t from = page.find(begin) + begin.size();
    return nlohmann::json::parse(page.substr(from, page.find("</script>", from) - from));
  };
  REQUIRE(study({"a", "b", "--out", "plain", "--seed", "0"}).status == 0);
  REQUIRE(study({"a", "b", "--out", "sent", "--seed", "0", "--collect", "https://a.org:8080/x?y=1", "--completion",
                 "C0DE42"})
              .status == 0);
  CHECK(data_of("plain")["collect"] == "");
  CHECK(data_of("plain")["completion"] == "");
  CHECK(data_of("sent")["collect"] == "https://a.org:8080/x?y=1");
  CHECK(data_of("sent")["completion"] == "C0DE42");
  CHECK(file_text("sent-key.json") == file_text("plain-key.json"));
}

TEST_CASE("names of a study without a seed follow from nothing that people could have") {
  const TemporaryFolder here;
  two_methods();
  std::set<std::string> names;
  for (const char* const page : {"one", "two"}) {
    REQUIRE(study({"a", "b", "--out", page}).status == 0);
    const nlohmann::json key = json_in(std::string(page) + "-key.json");
    names.insert({key["study"], key["salt"]});
    for (const nlohmann::json& pair : key["pairs"]) names.insert({pair["id"], pair["a"], pair["b"]});
    CHECK(key["salt"].get<std::string>().size() == 32);
    CHECK_THAT(file_text(fs::path(page) / "index.html"), !Contains(key["salt"].get<std::string>()));
    CHECK(read_study_key(std::string(page) + "-key.json").pairs.size() == 2);
  }
  CHECK(names.size() == 2 * (2 + 2 * 3));
}

namespace {

/// Gives the runs of a sweep previews, each with a grey of its own.
void show_runs(const MadeSweep& sweep, std::size_t first, std::size_t end) {
  for (std::size_t i = first; i < end; ++i)
    write_video(fs::path(sweep.paths().run(sweep.id(i))) / "preview.mp4",
                {0, 0.05F * static_cast<float>(i + 2), 0.5F, 1});
}

}  // namespace

TEST_CASE("two methods of a sweep are compared by clip and seed", "[full]") {
  MadeSweep sweep;
  sweep.finish_all();
  show_runs(sweep, 0, 11);
  const ProgramResult made = study({"made/plain", "made/other", "--out", "page", "--seed", "0"});
  INFO(made.err);
  REQUIRE(made.status == 0);
  CHECK_THAT(made.out, StartsWith("page/index.html: 5 pairs, of which a person is shown 5; ") &&
                           Contains("note: made/other: 1 run is left out, without a preview.mp4\n") &&
                           Contains("note: made/other lacks what made/plain has, which is left out: b, seed 2\n"));
  const nlohmann::json key = json_in("page-key.json");
  CHECK(key["a"] == "made/plain");
  const char* const names[] = {"a, seed 0", "a, seed 1", "a, seed 2", "b, seed 0", "b, seed 1"};
  for (std::size_t i = 0; i < 5; ++i) {
    CHECK(key["pairs"][i]["name"] == names[i]);
    const std::string a = key["pairs"][i]["a"], b = key["pairs"][i]["b"];
    CHECK(grey_of("page/videos/" + a + ".mp4") == Approx(0.05 * static_cast<double>(i + 2)).margin(0.02));
    CHECK(grey_of("page/videos/" + b + ".mp4") == Approx(0.05 * static_cast<double>(i + 8)).margin(0.02));
  }
  for (const char* word : {"made/", "plain", "seed 0"}) CHECK_THAT(file_text("page/index.html"), !Contains(word));

  // Single runs, runs beside those of another program, and what would be ambiguous.
  REQUIRE(study({"made/a, plain, seed 0", "made/a, other, seed 1", "--out", "one"}).status == 0);
  CHECK(json_in("one-key.json")["pairs"][0]["name"] == "pair");
  foreign_run("baseline/a", 0.9F);
  REQUIRE(study({"made/plain, seed 0", "baseline", "--out", "beside"}).status == 0);
  CHECK(json_in("beside-key.json")["pairs"][0]["name"] == "a");
  CHECK(refused({"made/plain", "made/other, seed 0", "--out", "x"}) ==
        "made/plain: \"a, plain, seed 0\" and \"a, plain, seed 1\" would both be compared with one run of the other "
        "side; name more of what the runs have\n");
  CHECK_THAT(refused({"made/plain", "made/others", "--out", "x"}), Contains("did you mean \"other\"?"));
}

TEST_CASE("a run that has several names is compared once") {
  const TemporaryFolder here;
  two_methods();
  fs::create_directory_symlink("walk", "a/latest");
  fs::create_directory_symlink("walk", "b/latest");
  fs::create_directory_symlink("..", "a/deep/up");
  const ProgramResult made = study({"a", "b", "--out", "page"});
  INFO(made.err);
  CHECK_THAT(made.out, StartsWith("page/index.html: 2 pairs, ") && !Contains("left out"));
}

TEST_CASE("the key of a study is beside its folder, however that is named, and not in it") {
  const TemporaryFolder here;
  const std::string at_hand = fs::current_path().string();
  for (const char* const folder : {".", "./", "page/.."}) CHECK(study_key_file(folder) == at_hand + "-key.json");
  CHECK(study_key_file("..") == fs::path(at_hand).parent_path().string() + "-key.json");
  for (const char* const folder : {"page", "page/", "./page/."}) CHECK(study_key_file(folder) == "page-key.json");
}

TEST_CASE("a study of two runs has one pair, and images of a run are better than its preview") {
  const TemporaryFolder here;
  own_run("a", 0.2F, "");
  foreign_run("b", 0.6F, 6, 30);
  fs::create_directory("a/frames");
  write_image("a/frames/0000_render.png", bars({0.9F}, 32, 32));
  std::ofstream("texts.json") << R"({"pair": "sits down"})";
  SECTION("all images") {
    write_image("a/frames/0001_render.png", bars({0.9F}, 32, 32));
    const ProgramResult made = study({"a", "b", "--out", "page", "--texts", "texts.json"});
    CHECK_THAT(made.out,
               Contains("1 pair, of which a person is shown 1;") &&
                   Contains("note: pair: the videos differ in form, which may decide the choice: A has 32x32 pixels, "
                            "0.2 s at 10 frames a second, B 16x16 pixels, 0.2 s at 30 frames a second\n"
                            "note: A is made of images and B of a video, which is thereby compressed twice and may "
                            "look worse for that: pair\n"));
    const nlohmann::json pair = json_in("page-key.json")["pairs"][0];
    CHECK(pair["text"] == "sits down");
    CHECK(grey_of("page/videos/" + pair["a"].get<std::string>() + ".mp4") == Approx(0.9).margin(0.02));
    CHECK(grey_of("page/videos/" + pair["b"].get<std::string>() + ".mp4") == Approx(0.6).margin(0.02));
  }
  SECTION("one is missing") {
    const ProgramResult made = study({"a", "b", "--out", "page", "--texts", "texts.json"});
    REQUIRE(made.status == 0);
    CHECK_THAT(made.out, !Contains("compressed twice"));
    const nlohmann::json pair = json_in("page-key.json")["pairs"][0];
    CHECK(grey_of("page/videos/" + pair["a"].get<std::string>() + ".mp4") == Approx(0.2).margin(0.02));
  }
}

TEST_CASE("what no study can be made of is told, and leaves nothing") {
  const TemporaryFolder here;
  foreign_run("a/x", 0.2F);
  foreign_run("b/y", 0.4F);
  foreign_run("c/x", 0.4F);
  fs::create_directories("empty/folder");
  CHECK(refused({"a", "b", "--out", "page"}) ==
        "a, b: no run is in both by the same name; the first has x, the second y\n");
  CHECK(refused({"a", "b/y", "--out", "page"}) ==
        "b/y is one run, a a folder of runs; a study compares two runs, or runs of the same names in two folders\n");
  CHECK(refused({"a", "empty", "--out", "page"}) ==
        "empty: holds no run with a preview.mp4, in it or in its folders; a run that has come to its end has one where "
        "ffmpeg is installed and log.preview is on\n");
  CHECK(refused({"a", "no", "--out", "page"}) == "no: there is no such folder\n");
  CHECK(refused({"a", "a/../a", "--out", "page"}) == "a/x, a/../a/x: are the same run; there is nothing to choose\n");
  CHECK(
      refused({"a", "--out", "page"}) ==
      "hsi4d study: compares two runs, or two folders of runs: A and B (1 given); --answers tells what people chose\n");
  CHECK(refused({"a", "c"}) == "hsi4d study: --out says where the page goes: a new or empty folder\n");
  CHECK(refused({"a", "c", "--out", "b"}) == "b: is not a new or empty folder\n");
  for (const char* address : {"study.org", "https://", "https://?x", "http://[", "https://a:99999",
                              "https://me:pw@a.org", "https://a.org/my answers"})
    CHECK(refused({"a", "c", "--out", "page", "--collect", address}) ==
          "hsi4d study: --collect: \"" + std::string(address) +
              "\" is no address; allowed: https://HOST, http://HOST:PORT/PATH and the like\n");
  CHECK(refused({"a", "c", "--out", "page", "--completion", "my code"}) ==
        "hsi4d study: --completion: \"my code\" is neither a code nor an address; allowed: characters of ASCII without "
        "spaces\n");
  CHECK(refused({"a", "c", "--out", "page", "--csv", "x.csv"}) == "hsi4d study: --csv is for --answers\n");
  std::ofstream("texts.json") << "{\n \"z\": \"sits\"}";
  CHECK(refused({"a", "c", "--out", "page", "--texts", "texts.json"}) ==
        "texts.json:2: /z: there is no such pair; there are x\n");
  own_run("d/x", 0.1F, "sits");
  own_run("e/x", 0.1F, "stands");
  CHECK(refused({"d", "e", "--out", "page"}) ==
        "d/x, e/x: were made of different texts, \"sits\" and \"stands\"; --texts says what both are to be compared "
        "with\n");
  std::ofstream("c/x/preview.mp4") << "no video";
  CHECK_THAT(refused({"a", "c", "--out", "page"}), Contains("c/x/preview.mp4"));
  CHECK_FALSE(fs::exists("page"));
  CHECK_FALSE(fs::exists("page-key.json"));
}

TEST_CASE("answers of a study are counted once for each person") {
  const TemporaryFolder here;
  two_methods();
  REQUIRE(study({"a", "b", "--out", "page"}).status == 0);
  const nlohmann::json key = json_in("page-key.json");
  fs::create_directory("in");
  write("in/1.json", answers_of(key, "one", true));
  write("in/2.json", answers_of(key, "two", false));
  fs::copy("in/1.json", "in/3.json");
  nlohmann::json corrected = answers_of(key, "two", true);  // two went back and saved again
  corrected["finished"] = "2026-01-02T10:05:00Z";
  write("in/0.json", corrected);
  nlohmann::json again = answers_of(key, "one", false);  // one took part a second time
  again["begun"] = "2026-01-03T10:00:00Z";
  again["finished"] = "2026-01-03T10:05:00Z";
  write("in/4.JSON", again);
  std::ofstream("in/list.txt") << "none";
  nlohmann::json half = answers_of(key, "three", true);
  half["answers"].erase(1);
  half["finished"] = "";
  write("half.json", half);
  const Names reads = {"study", "--key", "page-key.json", "--json", "o.json", "--csv", "o.csv", "--answers"};
  const auto tell = [&reads](const Names& files) {
    Names words = reads;
    words.insert(words.end(), files.begin(), files.end());
    return run_hsi4d(words);
  };
  const ProgramResult told = tell({"in", "half.json"});
  INFO(told.err);
  REQUIRE(told.status == 0);
  CHECK(told.out ==
        "question  persons  answers  prefer A [%]  95 % of answers  95 % over persons  Student's t     chose left [%]\n"
        "quality   3        5        100.0         56.6 to 100.0    100.0 to 100.0     100.0 to 100.0  100.0\n"
        "text      2        2        100.0         34.2 to 100.0    100.0 to 100.0     100.0 to 100.0  100.0\n"
        "\nA: a\nB: b\n3 persons, 2 pairs\n"
        "note: quality: 3 persons: of fewer than 10 both intervals over persons are rough, the bootstrap's is too "
        "narrow; Student's t is the one to quote\n"
        "note: text: 2 persons: of fewer than 10 both intervals over persons are rough, the bootstrap's is too narrow; "
        "Student's t is the one to quote\n"
        "note: in: holds other files, which are not read: list.txt\n"
        "note: in/2.json: is of the same person as in/0.json, which was finished later and counts alone\n"
        "note: in/3.json: is the same as in/1.json and counts once\n"
        "note: in/4.JSON: is of the same person as in/1.json, which was begun first and counts alone\n"
        "note: half.json: answers 1 of the 2 pairs that a person is shown; these count\n");
  const nlohmann::json numbers = json_in("o.json");
  CHECK(numbers["persons"] == 3);
  CHECK(numbers["questions"][0]["prefer_a"] == 5);
  CHECK(numbers["questions"][0]["pairs"][0]["name"] == "deep/sit");
  CHECK(numbers["questions"][0]["pairs"][0]["answers"] == 3);
  CHECK(numbers["questions"][1]["bootstrap"] == nlohmann::json({1, 1}));
  CHECK(numbers["questions"][1]["student_t"] == nlohmann::json({1, 1}));
  CHECK(numbers["notes"].size() == 7);
  const std::string lines = file_text("o.csv");
  CHECK_THAT(lines, Contains("two,deep/sit,quality,A,A,7,2\n"));
  // In any order of the files, and of a person who has not come to the end.
  REQUIRE(tell({"half.json", "in/4.JSON", "in/2.json", "in/1.json", "in/0.json"}).status == 0);
  CHECK(file_text("o.csv") == lines);
  nlohmann::json first = again;
  first["begun"] = "2025-12-31T10:00:00Z";
  first["finished"] = "";
  write("first.json", first);
  REQUIRE(tell({"first.json", "half.json", "in"}).status == 0);
  CHECK(file_text("o.csv") == lines);
}

TEST_CASE("what is written of a study replaces nothing that was read") {
  const TemporaryFolder here;
  two_methods();
  REQUIRE(study({"a", "b", "--out", "page"}).status == 0);
  fs::create_directory("in");
  write("in/1.json", answers_of(json_in("page-key.json"), "one", true));
  const std::string before = file_text("in/1.json");
  const auto refusal = [](const Names& more) {
    Names words = {"--answers", "in", "--key", "page-key.json"};
    words.insert(words.end(), more.begin(), more.end());
    return refused(words);
  };
  CHECK(refusal({"--json", "in/1.json"}) ==
        "hsi4d study: --json: in/1.json is the file that is read, in/1.json, which would be replaced; give another "
        "name\n");
  CHECK(
      refusal({"--csv", "in/../in/1.json"}) ==
      "hsi4d study: --csv: in/../in/1.json is the file that is read, in/1.json, which would be replaced; give another "
      "name\n");
  CHECK(refusal({"--csv", "o.txt", "--json", "in/../o.txt"}) ==
        "hsi4d study: --csv and --json are the same file, in/../o.txt\n");
  CHECK(refusal({"--seed", "3"}) == "hsi4d study: --seed is for making a study, not for --answers\n");
  CHECK(refusal({"--collect", "https://a.org"}) == "hsi4d study: --collect is for making a study, not for --answers\n");
  CHECK(refusal({"--pairs", "3"}) == "hsi4d study: --pairs is for making a study, not for --answers\n");
  CHECK(file_text("in/1.json") == before);
  CHECK_FALSE(fs::exists("o.txt"));
}

TEST_CASE("answers that do not belong to the study are refused with their file") {
  const TemporaryFolder here;
  two_methods();
  REQUIRE(study({"a", "b", "--out", "page"}).status == 0);
  REQUIRE(study({"a", "b", "--out", "other", "--seed", "1"}).status == 0);
  const nlohmann::json key = json_in("page-key.json");
  const auto refusal = [&key](const std::function<void(nlohmann::json&)>& change) {
    nlohmann::json answers = answers_of(key, "one", true);
    change(answers);
    std::ofstream("one.json") << answers.dump();
    return refused({"--answers", "one.json", "--key", "page-key.json"});
  };
  const std::string study_name = key["study"], a = key["pairs"][0]["a"];
  CHECK(refusal([](auto& file) { file["study"] = "0"; }) ==
        "one.json:1: /study: answers to another study, \"0\"; the key is of \"" + study_name + "\"\n");
  CHECK(refusal([](auto& file) { file["answers"][1]["pair"] = "x"; }) ==
        "one.json:1: /answers/1/pair: \"x\" is no pair of this study\n");
  CHECK(refusal([](auto& file) { file["answers"][0]["left"] = "x"; }) ==
        "one.json:1: /answers/0/left: \"x\" is no video of this pair\n");
  CHECK(refusal([&a](auto& file) { file["answers"][0]["right"] = a; }) ==
        "one.json:1: /answers/0/right: \"" + a + "\" is the video that is left, too\n");
  CHECK(refusal([](auto& file) { file["answers"][0]["chosen"]["quality"] = "none"; }) ==
        "one.json:1: /answers/0/chosen/quality: \"none\" is no video of this pair\n");
  CHECK(refusal([](auto& file) { file["answers"][1]["chosen"].erase("text"); }) ==
        "one.json:1: /answers/1/chosen: \"text\" is missing\n");
  CHECK(refusal([&a](auto& file) { file["answers"][0]["chosen"]["text"] = a; }) ==
        "one.json:1: /answers/0/chosen/text: this was not asked of the pair\n");
  CHECK(refusal([](auto& file) { file["answers"][1] = file["answers"][0]; }) ==
        "one.json:1: /answers/1: the pair is answered a second time\n");
  CHECK(refusal([](auto& file) { file["version"] = 2; }) ==
        "one.json:1: /version: 2 is not a version that is known; 1 is\n");
  CHECK(refusal([](auto& file) { file["person"] = ""; }) == "one.json:1: /person: is empty\n");
  CHECK(refused({"--answers", "page-key.json", "--key", "page-key.json"}) ==
        "page-key.json:2: /format: \"hsi4d study key\" is something else; \"hsi4d study answers\" is read here\n");
  write("one.json", answers_of(key, "one", true));
  CHECK_THAT(refused({"--answers", "one.json", "--key", "other-key.json"}),
             Contains("one.json:") && Contains("another study"));
  CHECK(refused({"--answers", "one.json"}) ==
        "hsi4d study: --key says which video is whose: the file that was made beside the study's folder, "
        "DIR-key.json\n");
  CHECK(refused({"a", "--answers", "one.json", "--key", "page-key.json"}) ==
        "hsi4d study: --answers are read without A and B, which the key knows; found a\n");
  // A key that was swapped by hand would turn the result round.
  nlohmann::ordered_json swapped = nlohmann::ordered_json::parse(file_text("page-key.json"));
  std::swap(swapped["pairs"][0]["a"], swapped["pairs"][0]["b"]);
  std::ofstream("swapped.json") << swapped.dump(2);
  CHECK_THAT(refused({"--answers", "one.json", "--key", "swapped.json"}),
             Matches("swapped.json:4: /study: \"" + study_name +
                     "\" is not that of this content, [0-9a-f]{16}: the key has been changed\n"));
}

}  // namespace study_test

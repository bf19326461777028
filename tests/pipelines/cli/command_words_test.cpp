#include "pipelines/cli/command_words.h"

#include <catch2/catch.hpp>

#include "core/check.h"

namespace command_words_test {

using namespace hsi4d;
using cli::CommandWords;

namespace {

/// A program with a plain command and one with parts.
const CommandWords kProgram = {
    "hsi4d",
    {{"draw", {}, {"--help", "--out"}}, {"body", {{"make", {}, {"--size"}}, {"tell", {}, {}}}, {"--help"}, true}},
    {}};

/// The message of a refusal; "" where the words are known.
std::string refusal(std::vector<const char*> words) {
  words.insert(words.begin(), "hsi4d");
  try {
    cli::check_words(static_cast<int>(words.size()), words.data(), kProgram);
  } catch (const UserError& error) {
    return error.what();
  }
  return "";
}

}  // namespace

TEST_CASE("words that commands know pass") {
  CHECK(refusal({"--version"}).empty());
  CHECK(refusal({"draw", "anything", "--out=a", "--help"}).empty());
  CHECK(refusal({"draw", "--", "--oot"}).empty());
  CHECK(refusal({"body", "--help"}).empty());
  CHECK(refusal({"body", "make", "--size", "3"}).empty());
}

TEST_CASE("words that commands do not know are told with the nearest one") {
  CHECK(refusal({}) == "hsi4d: give a command: draw, body; `hsi4d --help` explains them");
  CHECK(refusal({"drow"}) == "hsi4d: there is no command \"drow\"; known: draw, body; did you mean \"draw\"?");
  CHECK(refusal({"draw", "--oot=a"}) ==
        "hsi4d draw: there is no option \"--oot\"; known: --help, --out; did you mean \"--out\"?");
  CHECK(refusal({"body"}) == "hsi4d body: give a command; known: make, tell");
  CHECK(refusal({"body", "mak"}) ==
        "hsi4d body: there is no command \"mak\"; known: make, tell; did you mean \"make\"?");
  CHECK(refusal({"body", "make", "--sise", "3"}) ==
        "hsi4d body make: there is no option \"--sise\"; known: --size; did you mean \"--size\"?");
}

}  // namespace command_words_test

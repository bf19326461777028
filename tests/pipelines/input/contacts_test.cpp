#include "pipelines/input/contacts.h"

#include <string>

#include <catch2/catch.hpp>

#include "body/procedural_body.h"
#include "core/check.h"

namespace contacts_test {

using namespace hsi4d;

namespace {

const ContactNames kKnown = {{"can", "box"}, 9};

std::string file_of(const std::string& contacts) {
  return R"({"format": "hsi4d contacts", "version": 1, "contacts": [)" + contacts + "]}";
}

std::vector<AnnotatedContact> read(const std::string& contacts) {
  return decode_contacts(file_of(contacts), "c.json", kKnown);
}

std::string fault_in(const std::string& text) {
  try {
    decode_contacts(text, "c.json", kKnown);
  } catch (const DataError& fault) {
    return fault.what();
  }
  return "";
}

std::string fault_of(const std::string& contact) { return fault_in(file_of(contact)); }

}  // namespace

TEST_CASE("contacts are of a part or a vertex, with an object or a place of the scene") {
  const auto contacts = read(R"(
    {"frame": 4, "body": "left_foot", "object": "box"},
    {"frame": 0, "body": "right_hand", "object": "can", "point": [0.1, -0.2, 3], "weight": 0.25},
    {"frame": 8, "vertex": 12, "scene": [1, 2, -3]})");
  REQUIRE(contacts.size() == 3);
  CHECK(contacts[0].frame == 4);
  CHECK(contacts[0].joints == std::vector<Index>{smplx_joint("left_foot")});
  CHECK(contacts[0].object == 1);
  CHECK_FALSE(contacts[0].place);
  CHECK(contacts[0].weight == 1);
  CHECK(contacts[1].joints.size() == 16);  // the wrist, and 15 joints of fingers
  CHECK(contacts[1].joints.front() == smplx_joint("right_wrist"));
  for (std::size_t j = 1; j < contacts[1].joints.size(); ++j) CHECK(contacts[1].joints[j] >= 40);
  CHECK(contacts[1].object == 0);
  CHECK(*contacts[1].place == Vector3<double>(0.1, -0.2, 3));
  CHECK(contacts[1].weight == 0.25);
  CHECK(contacts[2].joints.empty());
  CHECK(contacts[2].vertex == 12);
  CHECK_FALSE(contacts[2].object);
  CHECK(*contacts[2].place == Vector3<double>(1, 2, -3));
  CHECK(read("").empty());
}

TEST_CASE("what is wrong with a contact is named with its place, its value and what is allowed") {
  const std::string at = "c.json:1: /contacts/0";
  CHECK(fault_of(R"({"frame": 9, "body": "head", "object": "can"})") ==
        at + "/frame: 9 is out of range; allowed: 0 to 8");
  CHECK(fault_of(R"({"frame": -1, "body": "head", "object": "can"})").find(at + "/frame: ") == 0);
  CHECK(fault_of(R"({"body": "head", "object": "can"})") == at + ": there is no \"frame\"");
  CHECK(fault_of(R"({"frame": 1, "body": "left_hant", "object": "can"})") ==
        at + "/body: there is no part \"left_hant\"; allowed: joints of SMPL-X, left_hand, right_hand; did you mean "
             "\"left_hand\"?");
  CHECK(fault_of(R"({"frame": 1, "body": 3, "object": "can"})").find(at + "/body: ") == 0);
  CHECK(fault_of(R"({"frame": 1, "object": "can"})") ==
        at + ": has neither \"body\" nor \"vertex\"; allowed: one of the two");
  CHECK(fault_of(R"({"frame": 1, "body": "head", "vertex": 2, "object": "can"})") ==
        at + ": has both \"body\" and \"vertex\"; allowed: one of the two");
  CHECK(fault_of(R"({"frame": 1, "body": "head"})") ==
        at + ": has neither \"object\" nor \"scene\"; allowed: one of the two");
  CHECK(fault_of(R"({"frame": 1, "body": "head", "object": "cans"})") ==
        at + "/object: there is no object \"cans\"; allowed: can, box; did you mean \"can\"?");
  CHECK(fault_of(R"({"frame": 1, "body": "head", "scene": [1, 2]})") ==
        at + "/scene: has 2 numbers; allowed: [x, y, z], metres");
  CHECK(fault_of(R"({"frame": 1, "body": "head", "scene": [1, 2, 1e7]})") ==
        at + "/scene/2: 1e7 is out of range; allowed: -1e6 to 1e6");
  CHECK(fault_of(R"({"frame": 1, "body": "head", "scene": [1, 2, 3], "point": [1, 2, 3]})") ==
        at + "/point: is of an object; \"scene\" is a point");
  CHECK(fault_of(R"({"frame": 1, "body": "head", "object": "can", "weight": 0})") ==
        at + "/weight: 0 is out of range; allowed: above 0, up to 1e6");
  CHECK(fault_of(R"({"frame": 1, "body": "head", "object": "can", "weigth": 1})") ==
        at + "/weigth: is not known; allowed: frame, body, vertex, object, point, scene, weight; did you mean "
             "\"weight\"?");
  CHECK(fault_in(R"({"format": "hsi4d contacts", "version": 2, "contacts": []})") ==
        "c.json:1: /version: 2 is not known; allowed: 1");
  CHECK(fault_in(R"({"format": "contacts", "version": 1, "contacts": []})") ==
        "c.json:1: /format: \"contacts\" is not known; allowed: \"hsi4d contacts\"");
  CHECK(fault_in(R"({"version": 1, "contacts": []})") == "c.json:1: there is no \"format\"");
  CHECK_THROWS_AS(decode_contacts(file_of(R"({"frame": 0, "body": "head", "object": "can"})"), "c.json", {{}, 1}),
                  DataError);
}

TEST_CASE("a contact of nothing that the body has is refused before a run") {
  const BodyModel body = procedural_body();
  const std::vector<AnnotatedContact> known = read(
      R"({"frame": 1, "body": "left_wrist", "scene": [0, 0, 0]}, {"frame": 1, "vertex": 18711, "scene": [0, 0, 0]})");
  CHECK_NOTHROW(check_contacts(known, &body, {}, "c.json"));
  CHECK_THROWS_WITH(check_contacts(read(R"({"frame": 1, "vertex": 18712, "scene": [0, 0, 0]})"), &body, {}, "c.json"),
                    "c.json: /contacts/0/vertex: 18712 is out of range; allowed: 0 to 18711");
  CHECK_THROWS_WITH(check_contacts(known, nullptr, body.weights, "c.json"),
                    "c.json: /contacts/1/vertex: the avatar is not made on `body`, so that its vertices are not known; "
                    "allowed: \"body\"");
  SparseWeights of_pelvis{.vertices = 1, .joints = kSmplxJoints, .per_vertex = 1, .indices = {0}, .weights = {1}};
  CHECK_THROWS_WITH(check_contacts({known.front()}, nullptr, of_pelvis, "c.json"),
                    "c.json: /contacts/0/body: no point of the avatar follows this part most");
}

}  // namespace contacts_test

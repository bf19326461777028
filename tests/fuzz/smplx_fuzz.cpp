// Files of SMPL-X body models, and what is made of them.
#include "body/smplx_body.h"
#include "core/npy.h"
#include "tests/fuzz/archive_list.h"

namespace hsi4d::fuzz::smplx_fuzz {

namespace {

std::vector<test::ZipMember> small_body(bool whole) {
  std::vector<test::ZipMember> members;
  const auto add = [&]<class T>(const std::string& name, std::initializer_list<int64_t> shape,
                                const std::vector<T>& numbers) {
    members.push_back({name + ".npy", encode_npy<T>(std::span(shape.begin(), shape.size()), numbers)});
  };
  const auto add_sixteenths = [&](const std::string& name, std::initializer_list<int64_t> shape) {
    int64_t count = 1;
    for (const int64_t n : shape) count *= n;
    add(name, shape, std::vector<float>(static_cast<std::size_t>(count), 0.0625F));
  };
  add("v_template", {1, 3}, std::vector<float>{0.5F, 1, 2});
  add("f", {1, 3}, std::vector<std::uint32_t>{0, 0, 0});
  std::vector<std::int64_t> tree(smplx_parents().begin(), smplx_parents().end());
  for (std::int64_t j = 0; j < 55; ++j) tree.push_back(j);
  add("kintree_table", {2, 55}, tree);
  std::vector<float> weights(55, 0.0F);
  weights[3] = 1;
  add("weights", {1, 55}, weights);
  add_sixteenths("shapedirs", {1, 3, whole ? 20 : 11});
  if (whole) {
    add_sixteenths("J_regressor", {55, 1});
    add_sixteenths("posedirs", {1, 3, 486});
    add_sixteenths("hands_meanl", {45});
    add_sixteenths("hands_componentsl", {2, 45});
  } else {
    add_sixteenths("J_template", {55, 3});
    add_sixteenths("J_shapedirs", {55, 3, 2});
    members.push_back({"joint2num.npy", test::pickled_npy()});
  }
  return members;
}

}  // namespace

std::vector<Bytes> corpus() {
  return {list_of(small_body(true)), list_of(small_body(false)), test::archive_of(small_body(false), false)};
}

bool accepts(std::span<const uint8_t> file) {
  return is_read([&] {
    const SmplxModel model = decode_smplx(archive_of(file), "fuzz.npz", {.betas = 1, .expressions = 1});
    is_read([&] { rest_body(model); });  // that of one vertex has no surface
    SmplxBody<float> body(model);
  });
}

const Target target("smplx", corpus, accepts);

}  // namespace hsi4d::fuzz::smplx_fuzz

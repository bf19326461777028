// L = mean over objects of |ĉ − c|²: ĉ = Σ m u / Σ m the centre of the object's rendered opacity m, c that of its mask
// in the frame.   [method, stage 2, which names neither unit nor norm]   unit: that of u. norm "l1": |Δx| + |Δy|.
// by_share: each times the share of the object that the frame shows. moves "object": ĉ moves as p does, the place of
// the object in the image, and no other way; of a hidden object, ĉ is p.
#include "autodiff/centroid.h"
#include "autodiff/elementwise.h"
#include "autodiff/map.h"
#include "autodiff/matrix.h"
#include "optim/losses/list.h"

namespace hsi4d {

namespace {

/// What the term has a gradient to.
enum class CenterMoves { kAll, kObject };

constexpr std::array<ConfigChoice<CenterMoves>, 2> kCenterMoves = {
    {{CenterMoves::kAll, "all"}, {CenterMoves::kObject, "object"}}};

/// What a distance in the image is told in: pixels; widths of the image; normalised device coordinates, in which image
/// is 2 wide and 2 high.
enum class CenterUnit { kPixels, kWidths, kNdc };

constexpr std::array<ConfigChoice<CenterUnit>, 3> kCenterUnits = {
    {{CenterUnit::kPixels, "pixels"}, {CenterUnit::kWidths, "widths"}, {CenterUnit::kNdc, "ndc"}}};

enum class CenterNorm { kSquared, kL1 };

constexpr std::array<ConfigChoice<CenterNorm>, 2> kCenterNorms = {
    {{CenterNorm::kSquared, "squared"}, {CenterNorm::kL1, "l1"}}};

/// In squared pixels the method's weight of 1e-3 makes an error of 5 px worth 0.025, as much as a photometric
/// difference of 6 grey levels. The term leads a lost object back, and fades below a pixel (1e-3), where colours say
/// more.
struct CenterSettings {
  CenterUnit unit = CenterUnit::kPixels;
  CenterNorm norm = CenterNorm::kSquared;
  double min_opacity = 1;  // pixels
  bool by_share = false;
  CenterMoves moves = CenterMoves::kAll;
};

void describe(ConfigFields& fields, CenterSettings& settings) {
  fields.choice("unit", settings.unit, kCenterUnits,
                "Unit of distances: pixels, widths of the image, or ndc, in which the image is 2 wide and 2 high");
  fields.choice("norm", settings.norm, kCenterNorms, "Of a distance: its square, or |Δx| + |Δy|");
  fields.number(
      "min_opacity", settings.min_opacity, {.min = 1e-6},
      "Opacity, in pixels, below which an object is hidden: the term is off or, with moves `object`, leads its place");
  fields.boolean("by_share", settings.by_share,
                 "An object counts by its visible share, so that the centre of a sliver does not push the human aside");
  fields.choice(
      "moves", settings.moves, kCenterMoves,
      "What has a gradient: all that the rendered opacity depends on, or the object's place and the camera alone");
}

/// Whether the term is on for an object.
template <class M, class V>
bool is_on(M mass, V visible, double min_opacity) {
  return mass >= static_cast<M>(min_opacity) && visible > V(0);
}

/// Rows (x, y, mass) of what is rendered, which change as the objects' places do. Of an object that is hidden they are
/// its place and the least mass, unless that is not before the camera.
template <class S>
Var<S> centres_by_place(const LossInputs<S>& in, double min_opacity) {
  const Var<S> rendered = stop_gradient(centroids(in.object_opacity)), place = stop_gradient(in.object_place);
  const auto column = [](Var<S> x, Index c) { return slice_cols(x, c, 1); };
  const Var<S> mass = column(rendered, 2);
  const S least = static_cast<S>(min_opacity);
  const auto either = [least](auto centre, auto m, auto p) { return select(value_of(m) >= least, centre, p); };
  const Var<S> at = map({slice_cols(rendered, 0, 2), mass, place}, either);
  const Var<S> counted = map({mass, column(place, 0), column(place, 1)}, [least](auto m, auto x, auto y) {
    const bool is_led = !(value_of(m) >= least) && (value_of(x) != S(0) || value_of(y) != S(0));
    return select(is_led, least, m);
  });
  const Var<S> moved = in.object_place - place;  // zeros, with a gradient
  return concat_cols<S>(std::array{at + moved, counted});
}

/// What a pixel is in a unit, along x and y.
template <class S>
std::array<S, 2> pixel_in(CenterUnit unit, const Shape& image) {
  const double width = static_cast<double>(image.cols), height = static_cast<double>(image.rows);
  if (unit == CenterUnit::kWidths) return {static_cast<S>(1 / width), static_cast<S>(1 / width)};
  if (unit == CenterUnit::kNdc) return {static_cast<S>(2 / width), static_cast<S>(2 / height)};
  return {S(1), S(1)};
}

/// Columns x, y, mass of the centres beside x, y, visible of the targets; each object's distance, 0 where it is off.
/// @param image  the images' shape
template <class S>
Var<S> mean_distance(Var<S> centres, Var<S> targets, const Shape& image, const CenterSettings& settings) {
  const std::array<S, 2> pixel = pixel_in<S>(settings.unit, image);
  const auto column = [](Var<S> x, Index c) { return slice_cols(x, c, 1); };
  const double least = settings.min_opacity;
  const bool by_share = settings.by_share, is_l1 = settings.norm == CenterNorm::kL1;
  const Var<S> total =
      sum_over({column(centres, 0), column(centres, 1), column(centres, 2), column(targets, 0), column(targets, 1),
                column(targets, 2)},
               [least, by_share, is_l1, pixel](auto x, auto y, auto mass, auto target_x, auto target_y, auto visible) {
                 const bool on = is_on(value_of(mass), value_of(visible), least);
                 const auto right = (x - target_x) * pixel[0], down = (y - target_y) * pixel[1];
                 const auto distance = select(is_l1, abs(right) + abs(down), square(right) + square(down));
                 return select(on, select(by_share, visible, S(1)) * distance, S(0));
               });
  return total * (1 / static_cast<double>(centres.shape().rows));
}

/// Objects that the frame shows and the render hides.
template <class S>
LeftOut hidden_objects(Var<S> centres, Var<S> targets, double min_opacity) {
  return {"center", "the opacity rendered of it sums to less than min_opacity", centres.shape().rows,
          [=](Index object) {
            const S mass = centres.owner().value(centres)(object, 2);
            const S visible = targets.owner().value(targets)(object, 2);
            return visible > S(0) && !is_on(mass, visible, min_opacity);
          }};
}

}  // namespace

LossTerm center_loss() {
  return needing({LossInput::kObjectOpacity},
                 make_loss_term<CenterSettings>(
                     "center", "Distance between the centre of each rendered object and that of its mask in the frame",
                     [](const auto& in, const CenterSettings& settings) {
                       using Value = decltype(in.object_opacity);
                       if (settings.moves == CenterMoves::kObject && !in.given(in.object_place)) return Value{};
                       const auto centres = settings.moves == CenterMoves::kAll
                                                ? centroids(in.object_opacity)
                                                : centres_by_place(in, settings.min_opacity);
                       if (in.left_out != nullptr) {
                         in.left_out->push_back(hidden_objects(centres, in.object_center_target, settings.min_opacity));
                       }
                       return mean_distance(centres, in.object_center_target, in.object_opacity.shape(), settings);
                     }));
}

}  // namespace hsi4d

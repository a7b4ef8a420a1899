#include "dqslam/online/relocalize.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <stdexcept>
#include <utility>

#include "dqslam/costs/whitening.h"
#include "dqslam/geometry/batch.h"
#include "dqslam/geometry/dispatch.h"
#include "dqslam/online/levenberg_marquardt.h"
#include "dqslam/online/linearize.h"
#include "dqslam/problem/options.h"

namespace dqslam::online {
namespace {

constexpr int kHeadings = 24;                       // of SE(2)
constexpr int kRotations = 400;                     // of SE(3): about 30 degrees apart
constexpr int kSeedBoxes = 3;                       // that hypotheses set out from
constexpr double kApart_m = 0.3, kApart_rad = 0.1;  // two places, not one
constexpr int kIterations = 8;  // with the noise of the start, and again with that of the end
constexpr double kTolerance = 1e-8;
// Keeps the equations definite where the boxes leave a direction of the pose open.
constexpr double kLeastInformation = 1e-9;

using Match = std::pair<int, int>;  // box, object

// Evenly spread: around the vertical, or over all rotations by the spiral of Alexa 2022.
template <typename Pose>
Eigen::Quaterniond Rotation(int i) {
  if constexpr (Pose::kModel == PoseModel::kSe2) {
    const double half = M_PI * i / kHeadings;
    return {std::cos(half), 0, 0, std::sin(half)};
  } else {
    const double s = i + 0.5, t = s / kRotations;
    const double a = 2 * M_PI * s / std::sqrt(2.0), b = 2 * M_PI * s / 1.533751168755204288118041;
    const double r = std::sqrt(t), q = std::sqrt(1 - t);
    return Eigen::Quaterniond(q * std::cos(b), r * std::sin(a), r * std::cos(a), q * std::sin(b));
  }
}

template <typename Pose>
class Search {
 public:
  static constexpr int k = Pose::kTangentSize;
  using Storage = Eigen::Matrix<double, Pose::kSize, 1>;
  using Square = Eigen::Matrix<double, k, k>;
  using Column = Eigen::Matrix<double, k, 1>;

  struct Place {
    Storage pose;
    std::vector<Match> matches;
    double chi_square = std::numeric_limits<double>::infinity();
    Square information = Square::Zero();
    static bool IsBetter(const Place& a, const Place& b) {
      if (a.matches.size() != b.matches.size()) return a.matches.size() > b.matches.size();
      return a.chi_square < b.chi_square;
    }
  };

  Search(const Camera& camera, const MapView& view)
      : model_(camera, ScenePriors(), 0), view_(view) {
    for (Eigen::Index row = 0; row < view.ellipsoids.rows(); ++row) {
      objects_.push_back(CenterShapeFromEllipsoid(view.ellipsoids.row(row).transpose()));
      const Matrix9d covariance = view.covariance.row(row).reshaped<Eigen::RowMajor>(9, 9);
      spread_.push_back(InformationInCenterShape(objects_.back(), covariance.inverse()).inverse());
    }
    for (Eigen::Index row = 0; row < view.box.rows(); ++row) {
      noise_.push_back(view.box_covariance.row(row).reshaped<Eigen::RowMajor>(4, 4));
      boxes_.emplace_back();
      boxes_.back().value = view.box.row(row).transpose();
      boxes_.back().truncated = view.truncated.row(row);
    }
  }

  // Places, best first, no two of them the same.
  std::vector<Place> Run() {
    for (const std::vector<Match>& matches : Hypotheses()) Try(matches);
    std::sort(places_.begin(), places_.end(), Place::IsBetter);
    return places_;
  }

 private:
  // Matches to begin with; the first one of each is the seed.
  std::vector<std::vector<Match>> Hypotheses() const {
    const auto& candidates = view_.candidates;
    std::vector<std::vector<Match>> hypotheses;
    const auto is_known = [](const std::vector<int>& objects) { return objects.size() <= 1; };
    if (std::all_of(candidates.begin(), candidates.end(), is_known)) {
      std::vector<Match> all;
      for (size_t box = 0; box < candidates.size(); ++box) {
        if (!candidates[box].empty()) all.push_back({box, candidates[box][0]});
      }
      for (size_t seed = 0; seed < std::min<size_t>(all.size(), kSeedBoxes); ++seed) {
        hypotheses.push_back(all);
        std::swap(hypotheses.back()[0], hypotheses.back()[seed]);
      }
      return hypotheses;
    }
    const int seeds = std::min<int>(candidates.size(), kSeedBoxes);
    for (int a = 0; a < seeds; ++a) {
      for (int b = a + 1; b < seeds; ++b) {
        for (const int i : candidates[a]) {
          for (const int j : candidates[b]) {
            if (i != j) hypotheses.push_back({{a, i}, {b, j}});
          }
        }
      }
    }
    return hypotheses;
  }

  // All headings from which the seed's box shows its object, refined on the matches.
  void Try(const std::vector<Match>& matches) {
    for (const Storage& start : Starts(matches[0])) {
      Place place{start, matches};
      Refine(&place);
      if (!(place.chi_square <= kBoxChiSquare999 * matches.size())) continue;
      for (int round = 0; round < 2; ++round) {
        place.matches = Assign(place.pose);
        if (place.matches.size() < 2) break;
        Refine(&place);
      }
      if (place.matches.size() >= 2) Keep(place);
    }
  }

  std::vector<Storage> Starts(const Match& seed) const {
    const Camera& camera = model_.camera;
    const Eigen::Vector4d& box = boxes_[seed.first].value;
    const Surface<double> object = SurfaceOf(objects_[seed.second]);
    const double radius = std::pow(object.shape.determinant(), 1.0 / 6);
    const double side = std::sqrt((box[2] - box[0]) / camera.fx * (box[3] - box[1]) / camera.fy);
    const Eigen::Vector3d ray((0.5 * (box[0] + box[2]) - camera.cx) / camera.fx,
                              (0.5 * (box[1] + box[3]) - camera.cy) / camera.fy,
                              1);
    const double depth = std::max(2 * radius / side, 1.5 * radius);
    const Eigen::Vector3d in_robot =
        model_.mount.camera_from_robot.transpose() * (depth * ray) + model_.mount.camera_in_robot;
    std::vector<Storage> starts;
    const int count = Pose::kModel == PoseModel::kSe2 ? kHeadings : kRotations;
    for (int i = 0; i < count; ++i) {
      const Eigen::Quaterniond turn = Rotation<Pose>(i);
      const Eigen::Vector3d t = object.center - turn * in_robot;
      starts.emplace_back();
      if constexpr (Pose::kModel == PoseModel::kSe2) {
        starts.back() << t.x(), t.y(), 2 * M_PI * i / kHeadings;
      } else {
        starts.back() << t, turn.coeffs();
      }
    }
    return starts;
  }

  Station StationAt(const Storage& pose) const {
    return Station::At<Pose>(pose.data(), model_.mount);
  }

  double CostOfBox(const Station& station, const Observation& box, double depth) const {
    double unused;
    return CostOfObservation<Pose>(model_, station, box, objects_[box.object], depth, &unused);
  }

  // The box of a match, with the map's uncertainty as a part of its noise.
  Observation Blurred(const Station& station, const Match& match) const {
    Observation box = boxes_[match.first];
    box.object = match.second;
    box.SetSqrtInformation(Eigen::Matrix4d::Identity());
    LinearizedObservation<Pose> linear;
    Linearize(model_, station, box, objects_[box.object], EdgeResidual::kBox, &linear);
    const auto& J = linear.by_object;
    const Eigen::Matrix4d total = noise_[match.first] + J * spread_[box.object] * J.transpose();
    const Eigen::LLT<Eigen::Matrix4d> cholesky(total);
    box.SetSqrtInformation(
        cholesky.info() == Eigen::Success
            ? Eigen::Matrix4d(cholesky.matrixL().solve(Eigen::Matrix4d::Identity()))
            : SqrtInformation<4>(noise_[match.first]));
    return box;
  }

  // Takes the pose to where it fits its matches best.
  void Refine(Place* place) const {
    for (int round = 0; round < 2; ++round) {
      std::vector<Observation> boxes;
      for (const Match& match : place->matches)
        boxes.push_back(Blurred(StationAt(place->pose), match));
      std::vector<double> depths(boxes.size(), 0);
      const auto linearize = [&](const Storage& pose, Square* H, Column* g) {
        const Station station = StationAt(pose);
        *H = kLeastInformation * Square::Identity();
        g->setZero();
        double cost = 0;
        LinearizedObservation<Pose> linear;
        for (size_t i = 0; i < boxes.size(); ++i) {
          const Vector9d& object = objects_[boxes[i].object];
          Linearize(model_, station, boxes[i], object, EdgeResidual::kBox, &linear);
          *H += linear.by_pose.transpose() * linear.by_pose;
          *g += linear.by_pose.transpose() * linear.residual;
          cost += linear.cost;
          depths[i] = linear.depth;
        }
        place->information = *H;
        return cost;
      };
      const auto retract = [](const Storage& pose, const Column& step, Storage* result) {
        *result = History<Pose>::Retract(pose, step);
        return true;
      };
      const auto cost_at = [&](const Storage& pose) {
        const Station station = StationAt(pose);
        double cost = 0;
        for (size_t i = 0; i < boxes.size(); ++i) cost += CostOfBox(station, boxes[i], depths[i]);
        return cost;
      };
      LevenbergMarquardt<k>(kIterations, kTolerance, &place->pose, linearize, retract, cost_at);
      depths.assign(boxes.size(), 0);  // infinite now where an object is not in front
      place->chi_square = 2 * cost_at(place->pose);
    }
  }

  // Each box to the object that it fits best, the best pairs first.
  std::vector<Match> Assign(const Storage& pose) const {
    const Station station = StationAt(pose);
    std::vector<std::pair<double, Match>> pairs;
    for (size_t box = 0; box < boxes_.size(); ++box) {
      for (const int object : view_.candidates[box]) {
        const Match match(box, object);
        const double chi_square = 2 * CostOfBox(station, Blurred(station, match), 0);
        if (chi_square <= kBoxChiSquare999) pairs.push_back({chi_square, match});
      }
    }
    std::sort(pairs.begin(), pairs.end());
    std::set<int> boxes_taken, objects_taken;
    std::vector<Match> matches;
    for (const auto& [chi_square, match] : pairs) {
      if (boxes_taken.count(match.first) || objects_taken.count(match.second)) continue;
      boxes_taken.insert(match.first);
      objects_taken.insert(match.second);
      matches.push_back(match);
    }
    std::sort(matches.begin(), matches.end());
    return matches;
  }

  void Keep(const Place& place) {
    constexpr int turns = Pose::kModel == PoseModel::kSe2 ? 1 : 3;
    for (Place& other : places_) {
      Column apart;
      Minus<Pose>(place.pose.data(), other.pose.data(), apart.data());
      if (apart.template head<k - turns>().norm() > kApart_m) continue;
      if (apart.template tail<turns>().norm() > kApart_rad) continue;
      if (Place::IsBetter(place, other)) other = place;
      return;
    }
    places_.push_back(place);
  }

  const Model model_;
  const MapView& view_;
  std::vector<Vector9d> objects_;  // center and shape
  std::vector<Matrix9d> spread_;   // covariance of each
  std::vector<Observation> boxes_;
  std::vector<Eigen::Matrix4d> noise_;  // covariance of each
  std::vector<Place> places_;
};

void CheckView(const MapView& view) {
  const Eigen::Index objects = view.ellipsoids.rows(), boxes = view.box.rows();
  RequireShape("ellipsoids", view.ellipsoids, objects, kLandmarkSize);
  RequireShape("covariance", view.covariance, objects, kLandmarkSize * kLandmarkSize);
  RequireShape("box", view.box, boxes, kBoxSize);
  RequireShape("box_covariance", view.box_covariance, boxes, kBoxSize * kBoxSize);
  RequireShape("truncated", view.truncated, boxes, kBoxSize);
  if (static_cast<Eigen::Index>(view.candidates.size()) != boxes) {
    throw std::invalid_argument("candidates: need one list for each of " + std::to_string(boxes) +
                                " boxes");
  }
  for (const std::vector<int>& rows : view.candidates) {
    for (const int row : rows) {
      if (row < 0 || row >= objects) {
        throw std::invalid_argument("candidates: " + std::to_string(row) + " is no object");
      }
    }
  }
}

}  // namespace

Relocation Relocalize(PoseModel pose_model, const Camera& camera, const MapView& view, int fewest) {
  if (fewest < 1) throw std::invalid_argument("relocalize: fewest must be at least 1");
  CheckView(view);
  int shown = 0;
  for (const std::vector<int>& objects : view.candidates) shown += !objects.empty();
  if (shown < fewest) {
    throw std::invalid_argument("relocalize: " + std::to_string(shown) +
                                " boxes show objects of the map, " + std::to_string(fewest) +
                                " are needed");
  }
  return Dispatch(pose_model, [&](auto model) {
    const auto places = Search<decltype(model)>(camera, view).Run();
    if (places.empty() || static_cast<int>(places[0].matches.size()) < fewest) {
      throw std::invalid_argument("relocalize: no pose explains " + std::to_string(fewest) +
                                  " of the boxes");
    }
    const auto& best = places[0];
    Relocation found;
    found.pose = best.pose;
    found.covariance = best.information.inverse();
    found.object = IndexVector::Constant(view.box.rows(), -1);
    for (const auto& [box, object] : best.matches) found.object[box] = object;
    found.chi_square = best.chi_square;
    found.matches = static_cast<int>(best.matches.size());
    if (places.size() > 1 && places[1].matches.size() == best.matches.size()) {
      found.runner_up = places[1].chi_square;
      found.other = places[1].pose;
    }
    return found;
  });
}

}  // namespace dqslam::online

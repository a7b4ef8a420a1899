#include "dqslam/online/relocalize.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "dqslam/costs/whitening.h"
#include "dqslam/geometry/dispatch.h"
#include "dqslam/online/linearize.h"

namespace dqslam::online {
namespace {

constexpr int kHeadings = 24;    // of SE(2)
constexpr int kRotations = 400;  // of SE(3): about 30 degrees apart
constexpr int kIterations = 15;
constexpr int kSeedBoxes = 3;                       // that hypotheses set out from
constexpr double kGate = 18.47;                     // chi-square of 4 degrees of freedom, 99.9 %
constexpr double kApart_m = 0.3, kApart_rad = 0.1;  // two places, not one

using Match = std::pair<int, int>;  // box, object

template <typename Pose>
class Search {
 public:
  using Storage = Eigen::Matrix<double, Pose::kSize, 1>;
  using Square = Eigen::Matrix<double, Pose::kTangentSize, Pose::kTangentSize>;

  struct Place {
    Storage pose;
    Square information;
    std::vector<Match> matches;
    double chi_square = std::numeric_limits<double>::infinity();
    bool IsBetterThan(const Place& other) const {
      if (matches.size() != other.matches.size()) return matches.size() > other.matches.size();
      return chi_square < other.chi_square;
    }
  };

  Search(const Camera& camera, const MapView& view)
      : model_(camera, ScenePriors(), 0), view_(view) {
    for (Eigen::Index row = 0; row < view.ellipsoids.rows(); ++row) {
      charts_.push_back(CenterShapeFromEllipsoid(view.ellipsoids.row(row).transpose()));
      using Square9 = Eigen::Matrix<double, 9, 9, Eigen::RowMajor>;
      const Matrix9d of_ellipsoid =
          Eigen::Map<const Square9>(view.covariance.row(row).data()).inverse();
      spread_.push_back(InformationInCenterShape(charts_.back(), of_ellipsoid).inverse());
    }
    for (Eigen::Index row = 0; row < view.box.rows(); ++row) {
      Observation observation{};
      observation.value = view.box.row(row).transpose();
      observation.truncated = view.truncated.row(row);
      using Square4 = Eigen::Matrix<double, 4, 4, Eigen::RowMajor>;
      noise_.push_back(Eigen::Map<const Square4>(view.box_covariance.row(row).data()));
      observation.sqrt_information = SqrtInformation<4>(noise_.back());
      sights_.push_back(observation);
    }
  }

  // Places, best first, no two of them the same.
  std::vector<Place> Run() {
    const bool is_known = std::all_of(view_.candidates.begin(),
                                      view_.candidates.end(),
                                      [](const auto& objects) { return objects.size() <= 1; });
    if (is_known) {
      std::vector<Match> all;
      for (size_t box = 0; box < sights_.size(); ++box) {
        if (!view_.candidates[box].empty()) all.push_back({box, view_.candidates[box][0]});
      }
      for (size_t seed = 0; seed < std::min<size_t>(all.size(), kSeedBoxes); ++seed) {
        Try(all[seed], all);
      }
    } else {
      TryPairs();
    }
    std::sort(places_.begin(), places_.end(), [](const Place& a, const Place& b) {
      return a.IsBetterThan(b);
    });
    return places_;
  }

 private:
  void TryPairs() {
    const int seeds = std::min<int>(sights_.size(), kSeedBoxes);
    for (int a = 0; a < seeds; ++a) {
      for (int b = a + 1; b < seeds; ++b) {
        for (const int i : view_.candidates[a]) {
          for (const int j : view_.candidates[b]) {
            if (i != j) Try({a, i}, {{a, i}, {b, j}});
          }
        }
      }
    }
  }

  // All headings from which the seed's box shows its object, refined on `matches`.
  void Try(const Match& seed, const std::vector<Match>& matches) {
    for (const Storage& start : Starts(seed)) {
      Place place;
      place.pose = start;
      place.matches = matches;
      Refine(&place);
      const bool fits = place.chi_square <= kGate * matches.size();
      if (!fits) continue;
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
    const Eigen::Vector4d& box = sights_[seed.first].value;
    const Surface<double> object = SurfaceOf(charts_[seed.second]);
    const double radius = std::pow(object.shape.determinant(), 1.0 / 6);
    const double side = std::sqrt((box[2] - box[0]) / camera.fx * (box[3] - box[1]) / camera.fy);
    const Eigen::Vector3d ray((0.5 * (box[0] + box[2]) - camera.cx) / camera.fx,
                              (0.5 * (box[1] + box[3]) - camera.cy) / camera.fy,
                              1);
    const double depth = std::max(2 * radius / side, 1.5 * radius);
    const Eigen::Matrix3d robot_from_camera = model_.mount.camera_from_robot.transpose();
    const Eigen::Vector3d in_robot =
        robot_from_camera * (depth * ray) + model_.mount.camera_in_robot;
    std::vector<Storage> starts;
    const int count = Pose::kModel == PoseModel::kSe2 ? kHeadings : kRotations;
    for (int i = 0; i < count; ++i) {
      const Eigen::Quaterniond turn = Rotation(i);
      const Eigen::Vector3d t = object.center - turn * in_robot;
      Storage start;
      if constexpr (Pose::kModel == PoseModel::kSe2) {
        start << t.x(), t.y(), 2 * M_PI * i / kHeadings;
      } else {
        start << t, turn.coeffs();
      }
      starts.push_back(start);
    }
    return starts;
  }

  // Evenly spread: around the vertical, or over all rotations by the spiral of Alexa 2022.
  static Eigen::Quaterniond Rotation(int i) {
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

  // The observation of a match, with the map's uncertainty as a part of its noise.
  Observation Blurred(const Station& station, const Match& match) const {
    Observation observation = sights_[match.first];
    Linear<Pose> linear;
    Observation bare = observation;
    bare.sqrt_information.setIdentity();
    Linearize<Pose>(model_, station, bare, charts_[match.second], Edges::kBox, &linear);
    const Eigen::Matrix4d total = noise_[match.first] + linear.by_object * spread_[match.second] *
                                                            linear.by_object.transpose();
    const Eigen::LLT<Eigen::Matrix4d> cholesky(total);
    if (cholesky.info() != Eigen::Success) return observation;
    observation.sqrt_information = cholesky.matrixL().solve(Eigen::Matrix4d::Identity());
    return observation;
  }

  void Refine(Place* place) const {
    double damping = 1e-3;
    std::vector<Observation> observations;
    for (int iteration = 0; iteration < kIterations; ++iteration) {
      const Station station = Station::At<Pose>(place->pose.data(), model_.mount);
      // Their noise depends on the pose: that of the start, and of the middle.
      if (iteration == 0 || iteration == kIterations / 2) {
        observations.clear();
        for (const Match& match : place->matches) observations.push_back(Blurred(station, match));
      }
      Square H = Square::Zero();
      Eigen::Matrix<double, Pose::kTangentSize, 1> g;
      g.setZero();
      double cost = 0;
      std::vector<double> depths;
      for (size_t i = 0; i < observations.size(); ++i) {
        Linear<Pose> linear;
        const Vector9d& center_shape = charts_[place->matches[i].second];
        Linearize<Pose>(model_, station, observations[i], center_shape, Edges::kBox, &linear);
        H += linear.by_pose.transpose() * linear.by_pose;
        g += linear.by_pose.transpose() * linear.residual;
        cost += linear.cost;
        depths.push_back(linear.depth);
      }
      place->information = H;
      Square damped = H;
      damped.diagonal() *= 1 + damping;
      damped.diagonal().array() += 1e-9;
      const Eigen::Matrix<double, Pose::kTangentSize, 1> step = -damped.ldlt().solve(g);
      Storage trial;
      Plus<Pose>(place->pose.data(), step.data(), trial.data());
      Pose::Normalize(trial.data());
      const double after = CostAt(trial, *place, observations, depths);
      if (after < cost) {
        place->pose = trial;
        damping /= 5;
        if (cost - after < 1e-8 * cost && iteration > kIterations / 2) break;
      } else {
        damping *= 10;
      }
    }
    place->chi_square =
        2 * CostAt(place->pose, *place, observations, std::vector<double>(observations.size()));
  }

  double CostAt(const Storage& pose,
                const Place& place,
                const std::vector<Observation>& observations,
                const std::vector<double>& depths) const {
    const Station station = Station::At<Pose>(pose.data(), model_.mount);
    double cost = 0, unused;
    for (size_t i = 0; i < observations.size(); ++i) {
      cost += CostOfObservation<Pose>(
          model_, station, observations[i], charts_[place.matches[i].second], depths[i], &unused);
    }
    return std::isfinite(cost) ? cost : std::numeric_limits<double>::infinity();
  }

  // Each box to the object that it fits best, the best pairs first.
  std::vector<Match> Assign(const Storage& pose) const {
    const Station station = Station::At<Pose>(pose.data(), model_.mount);
    std::vector<std::pair<double, Match>> pairs;
    for (size_t box = 0; box < sights_.size(); ++box) {
      for (const int object : view_.candidates[box]) {
        const Match match(box, object);
        double chi_square;
        CostOfObservation<Pose>(
            model_, station, Blurred(station, match), charts_[object], 0, &chi_square);
        if (chi_square <= kGate) pairs.push_back({chi_square, match});
      }
    }
    std::sort(pairs.begin(), pairs.end());
    std::vector<bool> box_taken(sights_.size(), false), object_taken(charts_.size(), false);
    std::vector<Match> matches;
    for (const auto& [chi_square, match] : pairs) {
      if (box_taken[match.first] || object_taken[match.second]) continue;
      box_taken[match.first] = object_taken[match.second] = true;
      matches.push_back(match);
    }
    std::sort(matches.begin(), matches.end());
    return matches;
  }

  void Keep(const Place& place) {
    for (Place& other : places_) {
      double tangent[Pose::kTangentSize];
      Minus<Pose>(place.pose.data(), other.pose.data(), tangent);
      constexpr int turns = Pose::kModel == PoseModel::kSe2 ? 1 : 3;
      double moved = 0, turned = 0;
      for (int i = 0; i < Pose::kTangentSize; ++i) {
        (i < Pose::kTangentSize - turns ? moved : turned) += tangent[i] * tangent[i];
      }
      if (std::sqrt(moved) > kApart_m || std::sqrt(turned) > kApart_rad) continue;
      if (place.IsBetterThan(other)) other = place;
      return;
    }
    places_.push_back(place);
  }

  const Model model_;
  const MapView& view_;
  std::vector<Vector9d> charts_;
  std::vector<Matrix9d> spread_;
  std::vector<Eigen::Matrix4d> noise_;
  std::vector<Observation> sights_;
  std::vector<Place> places_;
};

}  // namespace

Relocation Relocalize(PoseModel pose_model, const Camera& camera, const MapView& view, int fewest) {
  const auto shown = std::count_if(view.candidates.begin(),
                                   view.candidates.end(),
                                   [](const auto& objects) { return !objects.empty(); });
  if (shown < fewest) {
    throw std::invalid_argument("relocalize: " + std::to_string(shown) +
                                " boxes show objects of the map, " + std::to_string(fewest) +
                                " are needed");
  }
  return Dispatch(pose_model, [&](auto model) {
    using Pose = decltype(model);
    const auto places = Search<Pose>(camera, view).Run();
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
    found.runner_up = std::numeric_limits<double>::infinity();
    if (places.size() > 1 && places[1].matches.size() == best.matches.size()) {
      found.runner_up = places[1].chi_square;
      found.other = places[1].pose;
    }
    return found;
  });
}

}  // namespace dqslam::online

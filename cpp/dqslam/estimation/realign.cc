#include "dqslam/estimation/realign.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "dqslam/estimation/start_object.h"
#include "dqslam/geometry/dispatch.h"

namespace dqslam {
namespace {

using Eigen::Vector3d;

// The new poses see an object of known size.  Its center is that of a sphere of about this size.
constexpr double kSizeSpread = 0.1;
// How far off such a center may be, as a share of its distance.
constexpr double kTolerance = 0.1;
constexpr int kMostObjects = 12;  // those with the most boxes; all minimal sets of them are tried
constexpr int kBendings = 5;      // Gauss-Newton iterations of the path

// An object in two places: where the new poses see it, and where the map has it.
struct Pair {
  int object;
  Vector3d seen, known;
  double tolerance;  // meters
  int last_view;     // the last pose before the new ones that has a box of it
  size_t views;
};

template <typename Pose>
class Realignment {
 public:
  static constexpr int k = Pose::kTangentSize;
  static constexpr int kDimension = Pose::kModel == PoseModel::kSe2 ? 2 : 3;
  using Storage = Eigen::Matrix<double, Pose::kSize, 1>;
  using Square = Eigen::Matrix<double, k, k>;
  using Column = Eigen::Matrix<double, k, 1>;

  Realignment(const SolveContext& context, int begin, int end, const State& state)
      : context_(context), prepared_(context.prepared), begin_(begin), end_(end), before_(state) {}

  std::optional<State> Run(const std::vector<int>& known) const {
    const std::vector<Pair> pairs = FindPairs(known);
    std::vector<Pair> agreed;
    const std::optional<Storage> motion = FindMotion(pairs, &agreed);
    if (!motion) return std::nullopt;
    State state = before_;
    int anchor = 0;
    for (const Pair& pair : agreed) anchor = std::max(anchor, pair.last_view);
    Storage target;
    Pose::Compose(motion->data(), before_.poses.row(begin_).data(), target.data());
    Bend(anchor, target, &state);
    DeadReckon(prepared_, begin_ + 1, end_, &state);
    MoveObjects(anchor, &state);
    return state;
  }

 private:
  std::vector<Pair> FindPairs(const std::vector<int>& known) const {
    const Graph& graph = context_.graph();
    std::vector<Pair> pairs;
    for (const int object : known) {
      std::vector<int> rows;
      Pair pair{object, {}, {}, 0, 0, 0};
      for (const int row : prepared_.boxes_of_object[object]) {
        const int pose = graph.boxes.pose[row];
        if (pose < begin_) pair.last_view = pose;
        if (pose >= begin_ && pose < end_) rows.push_back(row);
      }
      if (rows.empty()) continue;
      const Surface<double> surface = EllipsoidModel::Unpack(before_.landmarks.row(object).data());
      const double radius = std::pow(surface.shape.determinant(), 1.0 / 6);
      const std::vector<View> views = ViewsOf(prepared_, before_, rows);
      pair.seen = FitSphere(graph.camera, views, {std::log(radius), kSizeSpread}).head<3>();
      pair.known = surface.center;
      double distance = 0;
      for (const View& view : views) {
        distance += (view.camera.position - pair.seen).norm() / views.size();
      }
      pair.tolerance = kTolerance * distance + radius;
      pair.views = rows.size();
      pairs.push_back(pair);
    }
    std::stable_sort(
        pairs.begin(), pairs.end(), [](const Pair& a, const Pair& b) { return a.views > b.views; });
    if (pairs.size() > kMostObjects) pairs.resize(kMostObjects);
    return pairs;
  }

  static Storage Fit(const std::vector<Pair>& pairs) {
    Eigen::MatrixXd seen(kDimension, pairs.size());
    Eigen::MatrixXd known(kDimension, pairs.size());
    for (size_t i = 0; i < pairs.size(); ++i) {
      seen.col(i) = pairs[i].seen.head<kDimension>();
      known.col(i) = pairs[i].known.head<kDimension>();
    }
    const Eigen::MatrixXd motion = Eigen::umeyama(seen, known, false);
    Storage result;
    if constexpr (Pose::kModel == PoseModel::kSe2) {
      result << motion(0, 2), motion(1, 2), std::atan2(motion(1, 0), motion(0, 0));
    } else {
      const Eigen::Matrix3d rotation = motion.topLeftCorner<3, 3>();
      result << motion.topRightCorner<3, 1>(), Eigen::Quaterniond(rotation).coeffs();
    }
    return result;
  }

  static double DistanceAfter(const Storage& motion, const Pair& pair) {
    const Rigid<double> rigid = Pose::template WorldFromRobot<double>(motion.data());
    const Vector3d error = rigid.rotation * pair.seen + rigid.translation - pair.known;
    return error.head<kDimension>().norm();
  }

  // The motion that most pairs agree about, from all minimal sets.
  static std::optional<Storage> FindMotion(const std::vector<Pair>& pairs,
                                           std::vector<Pair>* agreed) {
    double best = static_cast<double>(pairs.size());
    const auto judge = [&](const std::vector<Pair>& minimal) {
      const Storage motion = Fit(minimal);
      double loss = 0;
      std::vector<Pair> close;
      for (const Pair& pair : pairs) {
        const double error = DistanceAfter(motion, pair) / pair.tolerance;
        loss += std::min(error * error, 1.0);
        if (error < 1) close.push_back(pair);
      }
      if (close.size() < kDimension || loss >= best) return;
      best = loss;
      *agreed = close;
    };
    for (size_t a = 0; a < pairs.size(); ++a) {
      for (size_t b = 0; b < a; ++b) {
        if constexpr (kDimension == 2) {
          judge({pairs[a], pairs[b]});
        } else {
          for (size_t c = 0; c < b; ++c) judge({pairs[a], pairs[b], pairs[c]});
        }
      }
    }
    if (agreed->empty()) return std::nullopt;
    return Fit(*agreed);
  }

  // Spreads the motion of the pose `begin_` to its target over the steps of odometry behind the
  // anchor: the most likely steps under their covariances that lead there.
  void Bend(int anchor, const Storage& target, State* state) const {
    const OdometryTable& odometry = context_.graph().odometry;
    for (int iteration = 0; iteration < kBendings; ++iteration) {
      const double* reached = state->poses.row(begin_).data();
      std::vector<Square> gain(begin_ + 1);
      Square total = Square::Zero();
      for (int pose = anchor + 1; pose <= begin_; ++pose) {
        Storage between;
        Pose::Between(reached, state->poses.row(pose).data(), between.data());
        const Square J = Adjoint<Pose>(between.data());
        const Eigen::Map<const Eigen::Matrix<double, k, k, Eigen::RowMajor>> covariance(
            odometry.covariance.row(prepared_.odometry_into[pose]).data());
        gain[pose] = covariance * J.transpose();
        total += J * gain[pose];
      }
      Column missing;
      Minus<Pose>(target.data(), reached, missing.data());
      const Column multiplier = total.ldlt().solve(missing);
      RowMatrix old = state->poses.middleRows(anchor, begin_ - anchor + 1);
      for (int pose = anchor + 1; pose <= begin_; ++pose) {
        Storage step, moved;
        Pose::Between(
            old.row(pose - anchor - 1).data(), old.row(pose - anchor).data(), step.data());
        const Column change = gain[pose] * multiplier;
        Plus<Pose>(step.data(), change.data(), moved.data());
        double* result = state->poses.row(pose).data();
        Pose::Compose(state->poses.row(pose - 1).data(), moved.data(), result);
        Pose::Normalize(result);
      }
    }
    state->poses.row(begin_) = target.transpose();
  }

  // Moves each object that was last seen behind the anchor with the pose that saw it.
  void MoveObjects(int anchor, State* state) const {
    const Graph& graph = context_.graph();
    for (int object = 0; object < graph.num_objects(); ++object) {
      int viewer = -1;
      for (const int row : prepared_.boxes_of_object[object]) {
        if (graph.boxes.pose[row] < begin_) viewer = graph.boxes.pose[row];
      }
      if (viewer <= anchor) continue;
      const Rigid<double> from =
          Pose::template WorldFromRobot<double>(before_.poses.row(viewer).data());
      const Rigid<double> to =
          Pose::template WorldFromRobot<double>(state->poses.row(viewer).data());
      const Eigen::Matrix3d turn = to.rotation * from.rotation.transpose();
      Surface<double> surface = EllipsoidModel::Unpack(before_.landmarks.row(object).data());
      surface.center = turn * (surface.center - from.translation) + to.translation;
      surface.shape = turn * surface.shape * turn.transpose();
      state->landmarks.row(object) = EllipsoidFromSurface(surface).transpose();
    }
  }

  const SolveContext& context_;
  const PreparedGraph& prepared_;
  const int begin_, end_;
  const State& before_;
};

}  // namespace

std::optional<State> Realign(const SolveContext& context,
                             const std::vector<int>& known,
                             int begin,
                             int end,
                             const State& state) {
  if (context.options.landmark_model != LandmarkModel::kEllipsoid) return std::nullopt;
  return Dispatch(context.graph().pose_model, [&](auto pose) {
    return Realignment<decltype(pose)>(context, begin, end, state).Run(known);
  });
}

}  // namespace dqslam

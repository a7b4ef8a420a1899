#include "dqslam/estimation/placement_misfits.h"

#include <vector>

#include "dqslam/estimation/information.h"
#include "dqslam/problem/checks.h"
#include "dqslam/solver/terms.h"

namespace dqslam {
namespace {

// A visitor that evaluates each placement.
class Misfits {
 public:
  explicit Misfits(const State& state) : state_(state) {}

  template <typename Cost, typename... Rows>
  bool Visit(const Cost& cost, const Rows&... rows) {
    Eigen::Matrix<double, Cost::kResidualSize, 1> residual;
    if (!cost(ValuesOf(rows)..., residual.data())) return false;
    all_.push_back(NormBeforeSwitch(residual.norm()));
    return true;
  }
  const std::vector<double>& all() const { return all_; }

 private:
  const double* ValuesOf(ObjectRow object) const { return state_.landmarks.row(object.row).data(); }
  const double* ValuesOf(SharedRow shared) const { return state_.SharedAt(shared.row); }

  const State& state_;
  std::vector<double> all_;
};

}  // namespace

Eigen::VectorXd PlacementMisfits(const Graph& graph,
                                 const SolveOptions& options,
                                 const State& state) {
  CheckState("state", graph, state);
  Misfits misfits(state);
  VisitPlacements(graph, InformationTerms(graph, options, state), &misfits);
  return Eigen::Map<const Eigen::VectorXd>(misfits.all().data(),
                                           static_cast<Eigen::Index>(misfits.all().size()));
}

}  // namespace dqslam

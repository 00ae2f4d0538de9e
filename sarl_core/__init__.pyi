# The public names, each with its home: what is loaded when, and what type checkers see.
from .auditing.audit import Audit as Audit
from .auditing.audit import audit as audit
from .demonstrations.dataset import Demonstrations as Demonstrations
from .demonstrations.dataset import with_formulas as with_formulas
from .demonstrations.formats import load_demonstrations as load_demonstrations
from .demonstrations.formats import save_demonstrations as save_demonstrations
from .environments.environment import Environment as Environment
from .errors import InputError as InputError
from .errors import SarlError as SarlError
from .errors import WorkError as WorkError
from .explaining.exports.export import export_rules as export_rules
from .explaining.report.report import make_report as make_report
from .mining.algorithm_1 import mine_rules as mine_rules
from .mining.classifier import RuleClassifier as RuleClassifier
from .mining.combining.choice import with_combinations as with_combinations
from .mining.distributed.mined_data import MinedData as MinedData
from .mining.distributed.mined_files import load_mined_data as load_mined_data
from .mining.distributed.mined_files import save_mined_data as save_mined_data
from .mining.distributed.mining import mine_files as mine_files
from .mining.growing.growth import grow_policy_trees as grow_policy_trees
from .mining.rule_set import RuleSet as RuleSet
from .mining.rule_set import load_rules as load_rules
from .mining.rules import Rule as Rule
from .mining.thresholds.landscape import Landscape as Landscape
from .mining.thresholds.landscape import threshold_landscape as threshold_landscape
from .mining.tree import PolicyTree as PolicyTree
from .rendering.replay import render_episode as render_episode
from .rollouts.episodes import Episodes as Episodes
from .rollouts.episodes import rollout as rollout
from .rollouts.recording import record as record
from .rollouts.trial import make_agent as make_agent
from .shielding.shield import Decision as Decision
from .shielding.shield import Shield as Shield
from .shielding.vec_env import ShieldedVecEnv as ShieldedVecEnv
from .shielding.wrappers import ShieldedEnv as ShieldedEnv

__version__: str

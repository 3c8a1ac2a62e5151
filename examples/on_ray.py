"""The poses of a Parquet file on Ray: `pip install quest-pose[arrow] ray`, then `python on_ray.py pairs.parquet poses`.

The columns are those of `quest_pose.arrow.schema_in()`, `pair` among them: the same pair has the same answer in every batch.
"""

import sys

import pyarrow as pa
import ray
from quest_pose import arrow


def poses(batch: pa.Table) -> pa.Table:
    return pa.Table.from_batches([arrow.estimate(batch, threshold=1.0)])


if __name__ == "__main__":
    source, target = sys.argv[1:]
    pairs = ray.data.read_parquet(source)
    pairs.map_batches(poses, batch_format="pyarrow", batch_size=5000).write_parquet(target)

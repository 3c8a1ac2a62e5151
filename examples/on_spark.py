"""The poses of a Parquet file on Spark: `pip install quest-pose[arrow] pyspark`, then `python on_spark.py pairs.parquet poses`.

The columns are those of `quest_pose.arrow.schema_in()`, `pair` among them: the same pair has the same answer in every partition.
Spark has neither lists of a fixed size nor unsigned numbers: the poses are cast to what it has.
"""

import sys
from collections.abc import Iterator

import pyarrow as pa
from pyspark.sql import SparkSession
from pyspark.sql.pandas.types import from_arrow_schema
from quest_pose import arrow


def plain(kind: pa.DataType) -> pa.DataType:
    """The type of Spark's that holds a type of Arrow's."""
    if pa.types.is_fixed_size_list(kind) or pa.types.is_list(kind):
        return pa.list_(plain(kind.value_type))
    return pa.int64() if kind == pa.uint64() else kind


SCHEMA_OUT = pa.schema([(field.name, plain(field.type)) for field in arrow.schema_out()])


def poses(batches: Iterator[pa.RecordBatch]) -> Iterator[pa.RecordBatch]:
    for batch in batches:
        yield arrow.estimate(batch, threshold=1.0).cast(SCHEMA_OUT)


if __name__ == "__main__":
    source, target = sys.argv[1:]
    spark = SparkSession.builder.appName("poses").getOrCreate()
    pairs = spark.read.parquet(source)
    pairs.mapInArrow(poses, from_arrow_schema(SCHEMA_OUT)).write.parquet(target)

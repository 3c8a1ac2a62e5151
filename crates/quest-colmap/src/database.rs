//! An open database: its cameras, images and pairs.

use std::collections::{BTreeSet, HashMap};
use std::path::Path;
use std::time::Duration;

use quest_core::Camera;
use rusqlite::{Connection, OpenFlags, OptionalExtension};

use crate::image::{Matches, Rays, pixels};
use crate::{ColmapCamera, ColmapError, PairId, Schema};

/// How long to wait for another program that is writing.
const PATIENCE: Duration = Duration::from_millis(500);

/// An image of the table `images`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ImageRow {
    /// Its name.
    pub name: String,
    /// The key of its camera.
    pub camera: i64,
}

/// The keypoints of an image as they are stored, and its camera.
#[derive(Debug)]
pub(crate) struct Keypoints {
    rows: i64,
    cols: i64,
    data: Vec<u8>,
    pub(crate) camera: Camera,
}

impl Keypoints {
    /// As rays of the camera.
    pub(crate) fn rays(&self) -> Result<Rays, String> {
        Rays::new(self.rows, self.cols, &self.data, &self.camera)
    }

    /// As pixels.
    pub(crate) fn pixels(&self) -> Result<Vec<[f32; 2]>, String> {
        pixels(self.rows, self.cols, &self.data)
    }
}

/// A database of COLMAP.
#[derive(Debug)]
pub struct Database {
    pub(crate) connection: Connection,
    pub(crate) path: String,
    pub(crate) schema: Schema,
    /// By their numbers.
    pub(crate) images: HashMap<i64, ImageRow>,
    /// By their numbers.
    pub(crate) cameras: HashMap<i64, ColmapCamera>,
}

impl Database {
    /// Opens a database to read and, if that is possible, to write. Nothing is migrated.
    ///
    /// # Errors
    /// [`ColmapError::Missing`], [`ColmapError::NotColmap`], [`ColmapError::Sqlite`].
    pub fn open(path: &Path) -> Result<Self, ColmapError> {
        let name = path.display().to_string();
        if !path.is_file() {
            return Err(ColmapError::Missing { path: name });
        }
        let sqlite = |source| ColmapError::Sqlite { path: name.clone(), source };
        // Without SQLITE_OPEN_CREATE; SQLite opens a file that cannot be written to read.
        let flags = OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_NO_MUTEX;
        let connection = Connection::open_with_flags(path, flags).map_err(sqlite)?;
        connection.busy_timeout(PATIENCE).map_err(sqlite)?;
        let schema = Schema::read(&connection).map_err(sqlite)?;
        let schema = schema.map_err(|found| ColmapError::NotColmap { path: name.clone(), found })?;
        let cameras = cameras(&connection).map_err(sqlite)?;
        let images = images(&connection).map_err(sqlite)?;
        Ok(Self { connection, path: name, schema, images, cameras })
    }

    /// Lets the database grow to so many pages and no further, as on a disk that is full.
    ///
    /// # Errors
    /// [`ColmapError::Sqlite`].
    pub fn limit_pages(&mut self, pages: i64) -> Result<(), ColmapError> {
        let limit = format!("PRAGMA max_page_count = {pages}");
        let set = self.connection.query_row(&limit, [], |row| row.get::<_, i64>(0));
        set.map(|_| ()).map_err(|source| self.sqlite(source))
    }

    /// The columns that tell versions of COLMAP apart.
    #[must_use]
    pub fn schema(&self) -> &Schema {
        &self.schema
    }

    /// The images by their numbers.
    #[must_use]
    pub fn images(&self) -> &HashMap<i64, ImageRow> {
        &self.images
    }

    /// The cameras by their numbers.
    #[must_use]
    pub fn cameras(&self) -> &HashMap<i64, ColmapCamera> {
        &self.cameras
    }

    /// The numbers of the images by their names.
    #[must_use]
    pub fn numbers(&self) -> HashMap<String, i64> {
        self.images.iter().map(|(&number, image)| (image.name.clone(), number)).collect()
    }

    /// The pairs that have matches, in ascending order.
    ///
    /// # Errors
    /// [`ColmapError::Sqlite`].
    pub fn matched_pairs(&self) -> Result<BTreeSet<PairId>, ColmapError> {
        self.keys("SELECT pair_id FROM matches")
    }

    /// The pairs that have a row in `two_view_geometries`.
    ///
    /// # Errors
    /// [`ColmapError::Sqlite`].
    pub fn verified_pairs(&self) -> Result<BTreeSet<PairId>, ColmapError> {
        self.keys("SELECT pair_id FROM two_view_geometries")
    }

    /// The keys of named pairs, each once, in ascending order.
    ///
    /// # Errors
    /// [`ColmapError::Pairs`] for a name that the database does not have, and for an image paired with itself.
    pub fn keys_of(&self, pairs: &[(String, String)]) -> Result<Vec<PairId>, ColmapError> {
        Ok(crate::pairs::keys(pairs, &self.numbers())?.into_iter().collect())
    }

    fn keys(&self, sql: &str) -> Result<BTreeSet<PairId>, ColmapError> {
        let read = || -> rusqlite::Result<BTreeSet<PairId>> {
            let mut statement = self.connection.prepare(sql)?;
            statement.query_map([], |row| row.get(0).map(PairId))?.collect()
        };
        read().map_err(|source| self.sqlite(source))
    }

    /// The matches of a pair, or why they cannot be read.
    ///
    /// # Errors
    /// [`ColmapError::Sqlite`].
    pub fn matches(&self, pair: PairId) -> Result<Result<Matches, String>, ColmapError> {
        let sql = "SELECT rows, cols, data FROM matches WHERE pair_id = ?1";
        let read = || {
            let mut statement = self.connection.prepare_cached(sql)?;
            statement
                .query_row([pair.0], |row| {
                    let data = row.get_ref(2)?.as_blob_or_null().ok().flatten().unwrap_or_default();
                    Ok(Matches::new(row.get(0)?, row.get(1)?, data))
                })
                .optional()
        };
        let found = read().map_err(|source| self.sqlite(source))?;
        Ok(found.unwrap_or_else(|| Err("found no row in matches".to_owned())))
    }

    /// The keypoints of an image with its camera, or why there are none.
    ///
    /// # Errors
    /// [`ColmapError::Sqlite`].
    pub(crate) fn keypoints(&self, number: i64) -> Result<Result<Keypoints, String>, ColmapError> {
        let camera = self.camera_of(number).and_then(|camera| {
            camera.camera.clone().map_err(|reason| format!("camera {}: {reason}", camera.id))
        });
        let camera = match camera {
            Ok(camera) => camera,
            Err(reason) => return Ok(Err(reason)),
        };
        let sql = "SELECT rows, cols, data FROM keypoints WHERE image_id = ?1";
        let read = || {
            let mut statement = self.connection.prepare_cached(sql)?;
            statement
                .query_row([number], |row| {
                    let data = row.get_ref(2)?.as_blob_or_null().ok().flatten().unwrap_or_default();
                    Ok(Keypoints { rows: row.get(0)?, cols: row.get(1)?, data: data.to_vec(), camera })
                })
                .optional()
        };
        let found = read().map_err(|source| self.sqlite(source))?;
        Ok(found.ok_or_else(|| "found no keypoints".to_owned()))
    }

    /// The camera of an image, or why there is none.
    pub(crate) fn camera_of(&self, number: i64) -> Result<&ColmapCamera, String> {
        let image =
            self.images.get(&number).ok_or_else(|| format!("found no image {number} in the database"))?;
        let camera = self.cameras.get(&image.camera);
        camera.ok_or_else(|| format!("image {number}: found no camera {} in the database", image.camera))
    }

    pub(crate) fn name(&self, number: i64) -> String {
        self.images.get(&number).map_or_else(|| number.to_string(), |image| image.name.clone())
    }

    pub(crate) fn sqlite(&self, source: rusqlite::Error) -> ColmapError {
        ColmapError::Sqlite { path: self.path.clone(), source }
    }
}

fn cameras(connection: &Connection) -> rusqlite::Result<HashMap<i64, ColmapCamera>> {
    let sql = "SELECT camera_id, model, width, height, params, prior_focal_length FROM cameras";
    let mut statement = connection.prepare(sql)?;
    let rows = statement.query_map([], ColmapCamera::from_row)?;
    rows.map(|camera| camera.map(|camera| (camera.id, camera))).collect()
}

fn images(connection: &Connection) -> rusqlite::Result<HashMap<i64, ImageRow>> {
    let mut statement = connection.prepare("SELECT image_id, name, camera_id FROM images")?;
    let rows = statement
        .query_map([], |row| Ok((row.get(0)?, ImageRow { name: row.get(1)?, camera: row.get(2)? })))?;
    rows.collect()
}

//! Before anything is uploaded: the level as it is, made first if it is missing and wanted.

use mapfold_schema::v1;
use rand::Rng;
use tokio::sync::watch;
use tokio::time::{Instant, sleep};

use super::{ReplayError, ReplayOptions, ReplayProgress};
use crate::sync::{Api, ApiError, Backoff};

/// Who comes, and where to.
#[derive(Debug)]
pub struct Enrolment<'a> {
    /// What is asked for.
    pub options: &'a ReplayOptions,
    /// The sensors that the robot declares.
    pub sensors: Vec<v1::SensorProfile>,
}

impl Enrolment<'_> {
    /// The level's description. Waits for a server that is away, as an upload would.
    ///
    /// # Errors
    /// What the server refuses, with what was wanted of it; a level of another resolution.
    pub async fn level(
        &self,
        api: &Api,
        rng: &mut impl Rng,
        progress: &watch::Sender<ReplayProgress>,
    ) -> Result<v1::LevelDescription, ReplayError> {
        let address = &self.options.level;
        let upload = &self.options.upload;
        let deadline = upload.deadline.map(|after| Instant::now() + after);
        let mut backoff = Backoff::new(upload.backoff);
        let level = loop {
            match self.once(api).await {
                Ok(level) => break level,
                Err((_, error)) if error.is_retryable() => {
                    let wait = backoff.failed(error.retry_after(), rng);
                    if deadline.is_some_and(|d| Instant::now() + wait > d) {
                        return Err(ReplayError::GaveUp(error));
                    }
                    progress.send_modify(|p| p.trouble = Some(error.to_string()));
                    sleep(wait).await;
                }
                Err((what, source)) => return Err(ReplayError::Server { what, source }),
            }
        };
        progress.send_modify(|p| p.trouble = None);
        match self.options.resolution_m {
            Some(wanted_m) if (wanted_m - level.resolution_m).abs() > 1e-9 => {
                Err(ReplayError::Resolution {
                    level: address.clone(),
                    has_m: level.resolution_m,
                    wanted_m,
                })
            }
            _ => Ok(level),
        }
    }

    async fn once(&self, api: &Api) -> Result<v1::LevelDescription, (String, ApiError)> {
        let ReplayOptions { level: address, robot, create, resolution_m, .. } = self.options;
        let name = |what: &str| {
            let what = format!("{what} {address}");
            move |error| (what.clone(), error)
        };
        let level = match api.level(address).await {
            Err(error) if *create && is_missing(&error) => {
                let site = v1::NewSite { site: address.site.clone(), name: None };
                made(api.create_site(&site).await).map_err(name("cannot make the site of"))?;
                let level = v1::NewLevel {
                    level: address.level.clone(),
                    name: None,
                    resolution_m: *resolution_m,
                    elevation_m: None,
                    evidence_slice_s: None,
                };
                made(api.create_level(&address.site, &level).await)
                    .map_err(name("cannot make level"))?;
                api.level(address).await
            }
            other => other,
        };
        let hint =
            if *create { "cannot open level" } else { "without --create, cannot open level" };
        let level = level.map_err(name(hint))?;
        if *create {
            let of_robot = |error| (format!("cannot enrol robot {robot}"), error);
            match api.robot(&address.site, robot).await {
                Ok(known) if known.sensors == self.sensors => {}
                Ok(_) => {
                    let update = v1::RobotUpdate {
                        sensors: Some(self.sensors.clone()),
                        ..Default::default()
                    };
                    api.update_robot(&address.site, robot, &update).await.map_err(of_robot)?;
                }
                Err(error) if is_missing(&error) => {
                    let new = v1::NewRobot {
                        robot: robot.clone(),
                        name: None,
                        sensors: self.sensors.clone(),
                    };
                    made(api.create_robot(&address.site, &new).await).map_err(of_robot)?;
                }
                Err(error) => return Err(of_robot(error)),
            }
        }
        Ok(level)
    }
}

fn is_missing(error: &ApiError) -> bool {
    error.problem().is_some_and(|problem| problem.status == 404)
}

/// Made by us, or by another robot a moment before: either will do.
fn made<T>(result: Result<T, ApiError>) -> Result<(), ApiError> {
    match result {
        Ok(_) => Ok(()),
        Err(error) if error.problem().is_some_and(|p| p.status == 409) => Ok(()),
        Err(error) => Err(error),
    }
}
